// Surfaces of counts: a probability, or a rate, whose logit or logarithm is a polynomial; limits of a new count.
"use strict";

rsmkit.counts = (function () {
  // Of the trapezoidal rule over the error of the link: nodes up to so many standard errors, steps from the finest to the
  // coarsest, and the longest that is exact to rounding where the law of the count is as wide as the error.
  const MOST = 401, REACH = 8, STRIDES = [1, 2, 4, 5, 8, 10], LONGEST = 0.6;
  const rules = STRIDES.map(ruleOf);

  function ruleOf(stride) {
    const count = (MOST - 1) / stride + 1;
    const places = Float64Array.from({ length: count }, (_, i) => REACH * (2 * i / (count - 1) - 1));
    const weights = places.map((z) => Math.exp(-0.5 * z * z)), sum = weights.reduce((total, w) => total + w, 0);
    return { count, places, weights: weights.map((w) => w / sum) };
  }

  // The coarsest rule that is exact; `wide`: how many standard deviations of the count the error of the link makes.
  const ruleFor = (wide) => rules.findLast((_, i) => i === 0 || 2 * REACH * STRIDES[i] / (MOST - 1) <= LONGEST / Math.hypot(1, wide));

  // Logarithm of the gamma function of a positive number: Stirling's series above 10.
  function lnGamma(x) {
    let shift = 0;
    for (; x < 10; x++) shift += Math.log(x);
    const square = 1 / (x * x);
    return (x - 0.5) * Math.log(x) - x + 0.5 * Math.log(2 * Math.PI) - shift +
      (1 / 12 - square * (1 / 360 - square * (1 / 1260 - square * (1 / 1680 - square / 1188)))) / x;
  }

  const logistic = (eta) => (eta < 0 ? Math.exp(eta) / (1 + Math.exp(eta)) : 1 / (1 + Math.exp(-eta)));

  // The logarithm of a share, and of what is left of it, without cancellation.
  const logShare = (eta) => -(eta < 0 ? Math.log1p(Math.exp(eta)) - eta : Math.log1p(Math.exp(-eta)));

  const exponential = (eta) => Math.exp(Math.min(700, Math.max(-700, eta)));

  // Per distribution: the mean of the link's value, and of a count of some size its variance at a mean, the largest there
  // is, the logarithm of the probability of k, and by what that of k is multiplied for k + 1: odds (most - k) / (k + 1) with
  // the odds of a success, or rate / (k + 1).
  const LAWS = {
    binomial: { mean: logistic, spread: (mean, trials) => mean * (1 - mean / trials), most: (trials) => trials, odds: Math.exp,
      start: (k, eta, trials) => (k ? lnGamma(trials + 1) - lnGamma(k + 1) - lnGamma(trials - k + 1) + k * logShare(eta) : 0) + (trials - k) * logShare(-eta) },
    poisson: { mean: exponential, spread: (mean) => mean, most: () => Infinity, odds: (eta, exposure) => exposure * exponential(eta),
      start: (k, eta, exposure) => (k ? k * (Math.log(exposure) + eta) - lnGamma(k + 1) : 0) - exposure * exponential(eta) },
  };

  const [first, last, now, odds] = [0, 0, 0, 0].map(() => new Float64Array(MOST));

  // Equal-tailed limits of a new count whose link is known with an error: for both tails the least count up to which that
  // much of the law lies, averaged over the error.
  function limits(law, eta, error, size, tail) {
    const most = law.most(size);
    const widest = Math.max(...[-4, 0, 4].map((z) => law.spread(size * law.mean(eta + z * error), size)));
    const { count, places, weights } = ruleFor(error * Math.sqrt(widest));
    for (let i = 0; i < count; i++) {
      const link = eta + error * places[i], mean = size * law.mean(link), sd = Math.sqrt(law.spread(mean, size));
      first[i] = Math.max(0, Math.floor(mean - 12 * sd - 20));
      last[i] = Math.min(most, Math.ceil(mean + 12 * sd + 60));
      odds[i] = law.odds(link, size);
    }
    let begin = 0, end = 0, below = 0, low = null;  // nodes from begin to end have part of their law to come
    for (let k = first[0]; ; k++) {
      for (; end < count && first[end] <= k; end++) now[end] = weights[end] * Math.exp(law.start(first[end], eta + error * places[end], size));
      while (begin < end && last[begin] < k) begin++;
      const factor = most === Infinity ? 1 / (k + 1) : (most - k) / (k + 1);
      for (let i = begin; i < end; i++) {
        below += now[i];
        now[i] *= odds[i] * factor;
      }
      if (low === null && below >= tail) low = k;
      if (below >= 1 - tail || begin === count) return [low ?? k, k];
    }
  }

  // `polynomial` is the surface of the link.
  function surface({ distribution, size, quantile, tail, inner }, polynomial) {
    const law = LAWS[distribution];
    const predict = (point) => law.mean(polynomial.predict(point));
    function interval(point, noise = 1) {
      const eta = polynomial.predict(point), error = polynomial.leverage(point) ** 0.5;
      const ends = [-1, 1].map((side) => law.mean(eta + side * quantile * error));
      if (!noise) return ends;
      const [least, most] = limits(law, eta, error, size, tail);
      return [Math.min(ends[0], least / size), Math.max(ends[1], most / size)];
    }
    return { predict, interval, reach: (point) => polynomial.leverage(point) / inner.largest_leverage };
  }

  return { surface, lnGamma };
})();
