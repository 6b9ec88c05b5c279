/* Poses composed and inverted, for the base and tool frames of a robot: one row in each lane. */
#ifndef POSES_H
#define POSES_H

#include "rows.h"
#include "frames.h"

INLINE void with_angles(const real sine[3], const real cosine[3], real pose[6])
{
    for (int k = 0; k < 3; k++) pose[3 + k] = arctangent2(sine[k], cosine[k]);
}

INLINE void compose_row(const real a[6], const real b[6], real pose[6])
{
    real sine[3], cosine[3];
    FN(pose_compose)(a, b, pose, sine, cosine);
    with_angles(sine, cosine, pose);
}

INLINE void invert_row(const real a[6], real pose[6])
{
    real sine[3], cosine[3];
    FN(pose_invert)(a, pose, sine, cosine);
    with_angles(sine, cosine, pose);
}

#endif
