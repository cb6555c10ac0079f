// ESDIRK4(3)6L[2]SA: the implicit half of ARK4(3)6L[2]SA, C. A. Kennedy and M. H. Carpenter, Appl. Numer. Math. 44 (2003)
// 139-181, doi:10.1016/S0168-9274(02)00138-1. Six stages, the first explicit, gamma 1/4, L-stable, stiffly accurate.
#pragma once

namespace thermid {

constexpr int STAGES = 6;
constexpr double GAMMA = 0.25;
constexpr double NODE[STAGES] = {0.0, 0.5, 83.0 / 250.0, 31.0 / 50.0, 17.0 / 20.0, 1.0};
constexpr double A[STAGES][STAGES] = {
    {0.0},
    {0.25, 0.25},
    {8611.0 / 62500.0, -1743.0 / 31250.0, 0.25},
    {5012029.0 / 34652500.0, -654441.0 / 2922500.0, 174375.0 / 388108.0, 0.25},
    {15267082809.0 / 155376265600.0, -71443401.0 / 120774400.0, 730878875.0 / 902184768.0, 2285395.0 / 8070912.0, 0.25},
    {82889.0 / 524892.0, 0.0, 15625.0 / 83664.0, 69875.0 / 102672.0, -2260.0 / 8211.0, 0.25}};
constexpr const double* WEIGHT = A[STAGES - 1];
constexpr double EMBEDDED[STAGES] = {4586570599.0 / 29645900160.0, 0.0, 178811875.0 / 945068544.0, 814220225.0 / 1159782912.0,
                                     -3700637.0 / 11593932.0, 61727.0 / 225920.0};

// The middle of a step from its heats, T + h sum_s HALFWAY_s F_s: every condition of fourth order at half the step, the weights as small as these allow.
// In smooth runs it parts from the polynomial of the dense output by fifth order. After a jump, where the embedded estimate sees a sixteenth of what
// the end errs by (z below -8) and nothing of what lies within the step, it parts by a fifth of the larger of these two, down to z = -32.
constexpr double HALFWAY[STAGES] = {0.13169463, 0.11594734, 0.29430264, 0.01544248, -0.11420401, 0.05681692};

// Where a network is linear a step errs by (R - exp)(z), z = h C^-1 J, of what is not yet a polynomial in time; its error estimate D holds
// (R - R^)(z) of the same. Powers of M = 1 / (1 - gamma z) turn the one into the other: SHED[0] (M - M^2) D + SHED[1] (M^2 - M^3) D is the
// error to a twentieth of |M D| for z from -4 to 0, where the error is up to ten times |M D|. Of fifth order, whatever the laws.
constexpr double SHED[2] = {27.0803, -12.2017};

}  // namespace thermid
