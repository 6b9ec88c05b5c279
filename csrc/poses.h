/* Poses composed and inverted, for the base and tool frames of a robot. */
#ifndef POSES_H
#define POSES_H

#include "rows.h"
#include "frames.h"

INLINE void scatter_pose(const real p[3], const real sine[3], const real cosine[3], double *out,
                         const ptrdiff_t *row, int count)
{
    real pose[6];
    for (int k = 0; k < 3; k++) {
        pose[k] = p[k];
        pose[3 + k] = arctangent2(sine[k], cosine[k]);
    }
    scatter_row(pose, 6, out, 6, row, count);
}

/* out = A B; a stride is 0 where all rows share a pose, else 6. */
INLINE void compose_rows(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                         ptrdiff_t b_stride, double *out)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_a[6], lane_b[6], p[3], sine[3], cosine[3];
        const int count = block_rows(first, n, row);
        gather_row(a, a_stride, 6, row, lane_a);
        gather_row(b, b_stride, 6, row, lane_b);
        FN(pose_compose)(lane_a, lane_b, p, sine, cosine);
        scatter_pose(p, sine, cosine, out, row, count);
    }
}

INLINE void invert_rows(ptrdiff_t n, const double *a, double *out)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_a[6], p[3], sine[3], cosine[3];
        const int count = block_rows(first, n, row);
        gather_row(a, 6, 6, row, lane_a);
        FN(pose_invert)(lane_a, p, sine, cosine);
        scatter_pose(p, sine, cosine, out, row, count);
    }
}

/* Rates (n, 6, 6) of A T C by those of T, for poses T and A T C; a stride is as in compose_rows. */
INLINE void compose_rates_rows(ptrdiff_t n, const double *a, const double *pose, const double *c,
                               ptrdiff_t c_stride, const double *composed, double *rates)
{
    real lane_a[6];
    for (int k = 0; k < 6; k++) lane_a[k] = fill(a[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_c[6], lane_composed[6], out[36];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(c, c_stride, 6, row, lane_c);
        gather_row(composed, 6, 6, row, lane_composed);
        FN(pose_compose_rates)(lane_a, lane_pose, lane_c, lane_composed, out);
        scatter_row(out, 36, rates, 36, row, count);
    }
}

/* Twists (n, 6, 6) of A T C by those of T, for poses T. */
INLINE void compose_twists_rows(ptrdiff_t n, const double *a, const double *pose, const double *c,
                                double *twists)
{
    real lane_a[6], lane_c[6];
    for (int k = 0; k < 6; k++) {
        lane_a[k] = fill(a[k]);
        lane_c[k] = fill(c[k]);
    }
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], out[36];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_compose_twists)(lane_a, lane_pose, lane_c, out);
        scatter_row(out, 36, twists, 36, row, count);
    }
}

#endif
