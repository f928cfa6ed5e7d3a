# Steady temperature along a cylindrical cooling fin by finite volumes: an engineering code in 40 lines of awk.
# Reads "name value" lines; prints a report, writes the profile to profile.csv; exit code 2 for impossible input.
{ sub(/#.*/, "") }
NF == 2 { input[$1] = $2 }
END {
    L = input["length_mm"] / 1000; d = input["diameter_mm"] / 1000
    k = input["conductivity_W_mK"]; h = input["film_W_m2K"]
    n = input["cells"]; base = input["base_C"]; air = input["air_C"]
    if (L <= 0 || d <= 0 || k <= 0 || h <= 0 || n < 2) {
        print "fin.awk: lengths, conductivity, film coefficient must be positive" > "/dev/stderr"
        exit 2
    }
    pi = atan2(0, -1); area = pi * d * d / 4; dx = L / n
    conduct = k * area / dx; convect = h * pi * d * dx
    tip = 1 / (dx / (2 * k * area) + 1 / (h * area))      # half a cell of metal, then the film on the end face
    for (i = 1; i <= n; i++) {
        left = (i == 1) ? 2 * conduct : conduct            # the base is half a cell away
        right = (i == n) ? tip : conduct
        low[i] = -left; up[i] = -right; diag[i] = left + right + convect; rhs[i] = convect * air
        if (i == 1) rhs[i] += left * base
        if (i == n) rhs[i] += right * air
    }
    for (i = 2; i <= n; i++) {                             # Thomas algorithm
        w = low[i] / diag[i - 1]; diag[i] -= w * up[i - 1]; rhs[i] -= w * rhs[i - 1]
    }
    T[n] = rhs[n] / diag[n]
    for (i = n - 1; i >= 1; i--) T[i] = (rhs[i] - up[i] * T[i + 1]) / diag[i]
    print "position_mm, temperature_C" > "profile.csv"
    for (i = 1; i <= n; i++) printf "%.6f, %.12f\n", 1000 * (i - 0.5) * dx, T[i] > "profile.csv"
    print "COOLING FIN"
    printf "  heat flow [W]     : %.12f\n", 2 * conduct * (base - T[1])
    printf "  mass [g]          : %.12f\n", 1000 * input["density_kg_m3"] * area * L
    print "NORMAL END"
}
