/* Serial arms, for a page: see view.h. */
#include "view.h"
#include "serial.h"

enum { MOST = 32 }; /* joints */

/* What the page writes: doubles for all, so that their places are those of an array. */
typedef struct {
    double joints, prismatic[MOST], axes[9 * MOST], point[3 * MOST], home[16], error[6 * MOST];
} arm_numbers;
#define numbers ((const arm_numbers *)room)
_Static_assert(sizeof(arm_numbers) <= ROOM, "room");

static int32_t prismatic[MOST];
static double link[12 * (MOST + 1)];
static pkm_arm arm;
static const pkm_links links = {0, link};

static double q[MOST], tool[16], pose[6], jacobian[6 * MOST], frames[12 * (MOST + 1)];

EXPORT double *at(int which)
{
    double *const arrays[] = {q, tool, pose, jacobian, frames};
    return arrays[which];
}

EXPORT int begin(int bytes)
{
    if (bytes != (int)sizeof(arm_numbers) || numbers->joints < 1 || numbers->joints > MOST) return 0;
    arm = (pkm_arm){(int)numbers->joints, prismatic, numbers->axes, numbers->point, numbers->home};
    for (int i = 0; i < arm.joints; i++) prismatic[i] = numbers->prismatic[i] != 0.0;
    CALL(arm_links)(&arm, 1, numbers->error, link);
    return arm.joints;
}

/* q -> tool, its x y z and angles in pose, its twist by q, and the frame of each joint and the tool */
EXPORT int forward(void)
{
    real rows[12], angles[6];
    motion T;
    CALL(arm_forward)(&arm, &links, 1, q, tool);
    CALL(arm_jacobian)(&arm, &links, PKM_TIP, 1, q, jacobian);
    gather_row(tool, 12, 12, first_row, rows);
    motion_pose_row(rows, angles);
    scatter_row(angles, 6, pose, 6, first_row, 1);
    for (int i = 0; i <= arm.joints; i++) {
        follow_link(&links, arm.joints, i, first_row, &T);
        scatter_row(T.R, 9, frames + 12 * i, 12, first_row, 1);
        scatter_row(T.p, 3, frames + 12 * i + 9, 12, first_row, 1);
        if (i < arm.joints) move_joint(&arm, i, fill(q[i]), &T);
    }
    return 0;
}
