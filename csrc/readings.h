/* What an instrument reads at given poses: points of the platform and their distances. */
#ifndef READINGS_H
#define READINGS_H

#include "rows.h"
#include "measured.h"

INLINE void point_rows(ptrdiff_t n, const double *pose, const double *target,
                       ptrdiff_t target_stride, double *point, double *by_twist,
                       double *by_target)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_target[3], p[3], dp[18], dt[9];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(target, target_stride, 3, row, lane_target);
        FN(measured_point)(lane_pose, lane_target, p, dp, dt);
        scatter_row(p, 3, point, 3, row, count);
        scatter_row(dp, 18, by_twist, 18, row, count);
        scatter_row(dt, 9, by_target, 9, row, count);
    }
}

INLINE void seen_point_rows(ptrdiff_t n, const double *frame, const double *point, double *seen,
                            double *by_frame, double *by_point)
{
    real lane_frame[6];
    for (int k = 0; k < 6; k++) lane_frame[k] = fill(frame[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_point[3], s[3], df[18], dx[9];
        const int count = block_rows(first, n, row);
        gather_row(point, 3, 3, row, lane_point);
        FN(seen_point)(lane_frame, lane_point, s, df, dx);
        scatter_row(s, 3, seen, 3, row, count);
        scatter_row(df, 18, by_frame, 18, row, count);
        scatter_row(dx, 9, by_point, 9, row, count);
    }
}

INLINE void seen_pose_rows(ptrdiff_t n, const double *frame, const double *seen, double *by_twist)
{
    real lane_frame[6];
    for (int k = 0; k < 6; k++) lane_frame[k] = fill(frame[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_seen[6], out[36];
        const int count = block_rows(first, n, row);
        gather_row(seen, 6, 6, row, lane_seen);
        FN(measured_pose)(lane_frame, lane_seen, out);
        scatter_row(out, 36, by_twist, 36, row, count);
    }
}

INLINE void distance_rows(ptrdiff_t n, const double *pose, const double *target,
                          ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                          double *distance, double *by_twist, double *by_target, double *by_anchor)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_target[3], lane_anchor[3], rho, dp[6], dt[3], da[3];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(target, target_stride, 3, row, lane_target);
        gather_row(anchor, anchor_stride, 3, row, lane_anchor);
        FN(measured_distance)(lane_pose, lane_target, lane_anchor, &rho, dp, dt, da);
        scatter(rho, distance, 1, row, count);
        scatter_row(dp, 6, by_twist, 6, row, count);
        scatter_row(dt, 3, by_target, 3, row, count);
        scatter_row(da, 3, by_anchor, 3, row, count);
    }
}

#endif
