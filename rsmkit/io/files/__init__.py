"""Files and what operating systems do with them."""
