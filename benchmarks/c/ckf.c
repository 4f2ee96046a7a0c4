/* The corrected Kalman filter as a plain loop, O21 (17)-(21), (25), (26), for comparison.
 *
 * Compiled with -DN=n for n parameters; R1 = 0, and every replication starts from theta = 0 and
 * P = I. Arrays are row-major: y, e, inflation (T, R); phi, theta (T, R, N); P (T, R, N, N). What
 * follows a sample is written where `run_batch` of thermoctl has it, so that both can be compared.
 */

#include <stddef.h>

#ifndef N
#error "compile with -DN=number of parameters"
#endif

struct belief {
    const double *theta, *P;
};

static void update(struct belief before, const double *x, double y, double R2, double *theta,
                   double *P, double *e, double *inflation)
{
    double g[N], S = R2, innovation = y, weight, lambda;
    for (int i = 0; i < N; i++) {
        g[i] = 0.0;
        for (int j = 0; j < N; j++)
            g[i] += before.P[i * N + j] * x[j];
        innovation -= before.theta[i] * x[i];
        S += g[i] * x[i];
    }
    lambda = innovation * innovation / (S * (N + 1)); /* (26) */
    if (!(lambda > 1.0))
        lambda = 1.0;
    weight = 1.0 / S;
    for (int i = 0; i < N; i++) {
        theta[i] = before.theta[i] + g[i] * (weight * innovation); /* (18), (19) */
        /* The product comes first, so that P stays symmetric: lambda would let the rest grow. */
        for (int j = 0; j < N; j++)
            P[i * N + j] = lambda * (before.P[i * N + j] - g[i] * g[j] * weight); /* (21), (25) */
    }
    *e = innovation;
    *inflation = lambda;
}

void ckf(size_t T, size_t R, double R2, const double *y, const double *phi, double *theta,
         double *P, double *e, double *inflation)
{
    const double nothing[N] = {0};
    double unit[N * N] = {0};
    for (int i = 0; i < N; i++)
        unit[i * N + i] = 1.0;
    for (size_t at = 0; at < T * R; at++) {
        struct belief before = {nothing, unit};
        if (at >= R) {
            before.theta = theta + (at - R) * N;
            before.P = P + (at - R) * N * N;
        }
        update(before, phi + at * N, y[at], R2, theta + at * N, P + at * N * N, e + at,
               inflation + at);
    }
}
