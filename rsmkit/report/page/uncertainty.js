// What the laws of service do: written by Python, readable without JavaScript, and moved here from below the views.
"use strict";

rsmkit.uncertainty = (function () {
  function open() {
    const written = document.getElementById("service");
    if (written) rsmkit.views.add(written);
  }

  return { open };
})();
