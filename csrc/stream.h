/* Errors of poses, and moments and counts of values that come batch by batch and are not kept.
 *
 * Sums are of eight lanes whatever the processor has: the same bits with every isa.
 */
#ifndef STREAM_H
#define STREAM_H

#include "rows.h"

#define HALF_TURN 3.141592653589793

enum { SOME = 256, APART = 8, PER_SUM = APART / LANES }; /* columns at a time, sums side by side */

int CALL(pose_errors)(ptrdiff_t n, const double *pose, const double *meant, double *off)
{
    for (ptrdiff_t i = 0; i < n; i++, pose += 6) {
        double squares = 0.0;
        for (int j = 0; j < 6; j++) {
            double by = pose[j] - meant[j];
            if (j < 3) squares += by * by;
            else if (by < -HALF_TURN || by > HALF_TURN) by -= 2 * HALF_TURN * rint(by / (2 * HALF_TURN));
            off[j * n + i] = by;
        }
        off[6 * n + i] = sqrt(squares);
    }
    return 0;
}

/* What of `some` columns from `first` on is finite in all k quantities. */
SHARED int finite_columns(int k, ptrdiff_t n, const double *value, ptrdiff_t first, int some, int *at)
{
    double none[SOME] = {0};
    int count = 0;
    for (int j = 0; j < k; j++)
        for (int i = 0; i < some; i++) none[i] += 0.0 * value[j * n + first + i];
    for (int i = 0; i < some; i++)
        if (none[i] == 0.0) at[count++] = i;
    return count;
}

/* Mean, squares about it, least and most (4) of `count` numbers. */
SHARED void describe(int count, const double *x, double *moments)
{
    const int whole = count - count % APART;
    real sum[PER_SUM], squares[PER_SUM], least[PER_SUM], most[PER_SUM];
    double of[4][APART];
    for (int p = 0; p < PER_SUM; p++) {
        sum[p] = squares[p] = fill(0.0);
        least[p] = most[p] = fill(x[0]);
    }
    for (int i = 0; i < whole; i += APART)
        for (int p = 0; p < PER_SUM; p++) {
            const real some = load(x + i + p * LANES);
            sum[p] += some;
            least[p] = select(some < least[p], some, least[p]);
            most[p] = select(some > most[p], some, most[p]);
        }
    memcpy(of[0], sum, sizeof of[0]), memcpy(of[2], least, sizeof of[2]), memcpy(of[3], most, sizeof of[3]);
    for (int i = whole, l = 0; i < count; i++, l++) {
        of[0][l] += x[i];
        of[2][l] = x[i] < of[2][l] ? x[i] : of[2][l], of[3][l] = x[i] > of[3][l] ? x[i] : of[3][l];
    }
    for (int l = 1; l < APART; l++) {
        of[0][0] += of[0][l];
        of[2][0] = of[2][l] < of[2][0] ? of[2][l] : of[2][0];
        of[3][0] = of[3][l] > of[3][0] ? of[3][l] : of[3][0];
    }
    const double mean = of[0][0] / count;
    for (int i = 0; i < whole; i += APART)
        for (int p = 0; p < PER_SUM; p++) {
            const real some = load(x + i + p * LANES) - mean;
            squares[p] += some * some;
        }
    memcpy(of[1], squares, sizeof of[1]);
    for (int i = whole; i < count; i++) of[1][i - whole] += (x[i] - mean) * (x[i] - mean);
    for (int l = 1; l < APART; l++) of[1][0] += of[1][l];
    moments[0] = mean, moments[1] = of[1][0], moments[2] = of[2][0], moments[3] = of[3][0];
}

int CALL(stream)(int k, ptrdiff_t n, const double *value, const double *low,
                 const double *width, int bins, double *moments, int64_t *taken, int64_t *count)
{
    for (ptrdiff_t first = 0; first < n; first += SOME) {
        const int some = n - first < SOME ? (int)(n - first) : SOME;
        int at[SOME];
        const int good = finite_columns(k, n, value, first, some, at);
        taken[1] += some - good;
        if (!good) continue;
        const double total = (double)taken[0] + good, share = good / total;
        for (int j = 0; j < k; j++) {
            const double per_width = 1.0 / width[j], most = bins + 1.0;
            int64_t *in_bin = count + j * (bins + 2);
            double kept[SOME], of[4];
            int at_bin[SOME];
            const double *all = value + j * n + first, *x = good == some ? all : kept;
            if (good < some)
                for (int i = 0; i < good; i++) kept[i] = all[at[i]];
            describe(good, x, of);
            /* two sets together: Chan, Golub, LeVeque 1979 */
            const double step = of[0] - moments[j];
            moments[j] += share * step;
            moments[k + j] += of[1] + step * step * ((double)taken[0] * share);
            moments[2 * k + j] = of[2] < moments[2 * k + j] ? of[2] : moments[2 * k + j];
            moments[3 * k + j] = of[3] > moments[3 * k + j] ? of[3] : moments[3 * k + j];
            for (int i = 0; i < good; i++) {
                const double place = (x[i] - low[j]) * per_width + 1.0;
                const double within = place < most ? place : most;
                at_bin[i] = (int)(within > 0.0 ? within : 0.0);
            }
            for (int i = 0; i < good; i++) in_bin[at_bin[i]]++;
        }
        taken[0] += good;
    }
    return 0;
}

#endif
