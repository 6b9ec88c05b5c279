/* Generated from derive/calls.py by `python -m derive`; never edited by hand.
 * derivation d865869e1ea08652
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

int CALL(compose)(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                  ptrdiff_t b_stride, double *out)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_a[6], lane_b[6], lane_out[6];
        const int count = block_rows(first, n, row);
        gather_row(a, a_stride, 6, row, lane_a);
        gather_row(b, b_stride, 6, row, lane_b);
        FN(pose_compose)(lane_a, lane_b, lane_out);
        scatter_row(lane_out, 6, out, 6, row, count);
    }
    return 0;
}

int CALL(invert)(ptrdiff_t n, const double *a, double *out)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_a[6], lane_out[6];
        const int count = block_rows(first, n, row);
        gather_row(a, 6, 6, row, lane_a);
        FN(pose_invert)(lane_a, lane_out);
        scatter_row(lane_out, 6, out, 6, row, count);
    }
    return 0;
}

int CALL(compose_rates)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                        ptrdiff_t c_stride, const double *composed, double *rates)
{
    real lane_a[6];
    for (int k = 0; k < 6; k++) lane_a[k] = fill(a[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_c[6], lane_composed[6], lane_rates[36];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(c, c_stride, 6, row, lane_c);
        gather_row(composed, 6, 6, row, lane_composed);
        FN(pose_compose_rates)(lane_a, lane_pose, lane_c, lane_composed, lane_rates);
        scatter_row(lane_rates, 36, rates, 36, row, count);
    }
    return 0;
}

int CALL(compose_twists)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                         double *twists)
{
    real lane_a[6];
    for (int k = 0; k < 6; k++) lane_a[k] = fill(a[k]);
    real lane_c[6];
    for (int k = 0; k < 6; k++) lane_c[k] = fill(c[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_twists[36];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_compose_twists)(lane_a, lane_pose, lane_c, lane_twists);
        scatter_row(lane_twists, 36, twists, 36, row, count);
    }
    return 0;
}

int CALL(points)(ptrdiff_t n, const double *pose, const double *target, ptrdiff_t target_stride,
                 double *point, double *by_twist, double *by_target)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_target[3], lane_point[3], lane_by_twist[18], lane_by_target[9];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(target, target_stride, 3, row, lane_target);
        FN(measured_point)(lane_pose, lane_target, lane_point, lane_by_twist, lane_by_target);
        scatter_row(lane_point, 3, point, 3, row, count);
        scatter_row(lane_by_twist, 18, by_twist, 18, row, count);
        scatter_row(lane_by_target, 9, by_target, 9, row, count);
    }
    return 0;
}

int CALL(seen_points)(ptrdiff_t n, const double *frame, const double *point, double *seen,
                      double *by_frame, double *by_point)
{
    real lane_frame[6];
    for (int k = 0; k < 6; k++) lane_frame[k] = fill(frame[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_point[3], lane_seen[3], lane_by_frame[18], lane_by_point[9];
        const int count = block_rows(first, n, row);
        gather_row(point, 3, 3, row, lane_point);
        FN(seen_point)(lane_frame, lane_point, lane_seen, lane_by_frame, lane_by_point);
        scatter_row(lane_seen, 3, seen, 3, row, count);
        scatter_row(lane_by_frame, 18, by_frame, 18, row, count);
        scatter_row(lane_by_point, 9, by_point, 9, row, count);
    }
    return 0;
}

int CALL(distances)(ptrdiff_t n, const double *pose, const double *target, ptrdiff_t target_stride,
                    const double *anchor, ptrdiff_t anchor_stride, const double *zero,
                    ptrdiff_t zero_stride, double *distance, double *by_twist, double *by_target,
                    double *by_anchor)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_target[3], lane_anchor[3], lane_zero[1], lane_distance[1],
             lane_by_twist[6], lane_by_target[3], lane_by_anchor[3];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(target, target_stride, 3, row, lane_target);
        gather_row(anchor, anchor_stride, 3, row, lane_anchor);
        gather_row(zero, zero_stride, 1, row, lane_zero);
        FN(measured_distance)(lane_pose, lane_target, lane_anchor, lane_zero, lane_distance,
                              lane_by_twist, lane_by_target, lane_by_anchor);
        scatter_row(lane_distance, 1, distance, 1, row, count);
        scatter_row(lane_by_twist, 6, by_twist, 6, row, count);
        scatter_row(lane_by_target, 3, by_target, 3, row, count);
        scatter_row(lane_by_anchor, 3, by_anchor, 3, row, count);
    }
    return 0;
}

int CALL(between)(ptrdiff_t n, const double *pose, const double *other, const double *target,
                  ptrdiff_t target_stride, double *distance, double *by_twist, double *by_other,
                  double *by_target)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_other[6], lane_target[3], lane_distance[1], lane_by_twist[6],
             lane_by_other[6], lane_by_target[3];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(other, 6, 6, row, lane_other);
        gather_row(target, target_stride, 3, row, lane_target);
        FN(measured_between)(lane_pose, lane_other, lane_target, lane_distance, lane_by_twist,
                             lane_by_other, lane_by_target);
        scatter_row(lane_distance, 1, distance, 1, row, count);
        scatter_row(lane_by_twist, 6, by_twist, 6, row, count);
        scatter_row(lane_by_other, 6, by_other, 6, row, count);
        scatter_row(lane_by_target, 3, by_target, 3, row, count);
    }
    return 0;
}

int CALL(touched_points)(ptrdiff_t n, const double *artefact, ptrdiff_t artefact_stride,
                         const double *point, double *inside, double *by_artefact, double *by_point)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_artefact[6], lane_point[3], lane_inside[3], lane_by_artefact[18],
             lane_by_point[9];
        const int count = block_rows(first, n, row);
        gather_row(artefact, artefact_stride, 6, row, lane_artefact);
        gather_row(point, 3, 3, row, lane_point);
        FN(touched_point)(lane_artefact, lane_point, lane_inside, lane_by_artefact, lane_by_point);
        scatter_row(lane_inside, 3, inside, 3, row, count);
        scatter_row(lane_by_artefact, 18, by_artefact, 18, row, count);
        scatter_row(lane_by_point, 9, by_point, 9, row, count);
    }
    return 0;
}

int CALL(tilts)(ptrdiff_t n, const double *pose, const double *mounting, ptrdiff_t mounting_stride,
                const double *up, ptrdiff_t up_stride, double *tilt, double *by_turn,
                double *by_mounting, double *by_up)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], lane_mounting[3], lane_up[3], lane_tilt[2], lane_by_turn[6],
             lane_by_mounting[6], lane_by_up[6];
        const int count = block_rows(first, n, row);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(mounting, mounting_stride, 3, row, lane_mounting);
        gather_row(up, up_stride, 3, row, lane_up);
        FN(measured_tilt)(lane_pose, lane_mounting, lane_up, lane_tilt, lane_by_turn,
                          lane_by_mounting, lane_by_up);
        scatter_row(lane_tilt, 2, tilt, 2, row, count);
        scatter_row(lane_by_turn, 6, by_turn, 6, row, count);
        scatter_row(lane_by_mounting, 6, by_mounting, 6, row, count);
        scatter_row(lane_by_up, 6, by_up, 6, row, count);
    }
    return 0;
}

int CALL(pixels)(ptrdiff_t n, const double *board, const double *corner, const double *lens,
                 ptrdiff_t lens_stride, const double *size, ptrdiff_t size_stride, double *seen,
                 double *by_twist, double *by_lens, double *by_size, double *depth)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_board[6], lane_corner[3], lane_lens[9], lane_size[1], lane_seen[2],
             lane_by_twist[12], lane_by_lens[18], lane_by_size[2], lane_depth[1];
        const int count = block_rows(first, n, row);
        gather_row(board, 6, 6, row, lane_board);
        gather_row(corner, 3, 3, row, lane_corner);
        gather_row(lens, lens_stride, 9, row, lane_lens);
        gather_row(size, size_stride, 1, row, lane_size);
        FN(measured_pixel)(lane_board, lane_corner, lane_lens, lane_size[0], lane_seen,
                           lane_by_twist, lane_by_lens, lane_by_size, lane_depth);
        scatter_row(lane_seen, 2, seen, 2, row, count);
        scatter_row(lane_by_twist, 12, by_twist, 12, row, count);
        scatter_row(lane_by_lens, 18, by_lens, 18, row, count);
        scatter_row(lane_by_size, 2, by_size, 2, row, count);
        scatter_row(lane_depth, 1, depth, 1, row, count);
    }
    return 0;
}

int CALL(law_drive)(ptrdiff_t n, const double *x, double *way, double *by_x, double *bend)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_x[5], lane_way[1], lane_by_x[5], lane_bend[1];
        const int count = block_rows(first, n, row);
        gather_row(x, 5, 5, row, lane_x);
        FN(law_drive)(lane_x, lane_way, lane_by_x, lane_bend);
        scatter_row(lane_way, 1, way, 1, row, count);
        scatter_row(lane_by_x, 5, by_x, 5, row, count);
        scatter_row(lane_bend, 1, bend, 1, row, count);
    }
    return 0;
}

int CALL(law_drive_inverse)(ptrdiff_t n, const double *x, double *q)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_x[5], lane_q[1];
        const int count = block_rows(first, n, row);
        gather_row(x, 5, 5, row, lane_x);
        FN(law_drive_inverse)(lane_x, lane_q);
        scatter_row(lane_q, 1, q, 1, row, count);
    }
    return 0;
}

int CALL(law_harmonic)(ptrdiff_t n, const double *x, double *error, double *by_x, double *bend)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_x[4], lane_error[1], lane_by_x[3], lane_bend[1];
        const int count = block_rows(first, n, row);
        gather_row(x, 4, 4, row, lane_x);
        FN(law_harmonic)(lane_x, lane_error, lane_by_x, lane_bend);
        scatter_row(lane_error, 1, error, 1, row, count);
        scatter_row(lane_by_x, 3, by_x, 3, row, count);
        scatter_row(lane_bend, 1, bend, 1, row, count);
    }
    return 0;
}

int CALL(law_segment)(ptrdiff_t n, const double *x, double *error, double *by_x)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_x[5], lane_error[1], lane_by_x[3];
        const int count = block_rows(first, n, row);
        gather_row(x, 5, 5, row, lane_x);
        FN(law_segment)(lane_x, lane_error, lane_by_x);
        scatter_row(lane_error, 1, error, 1, row, count);
        scatter_row(lane_by_x, 3, by_x, 3, row, count);
    }
    return 0;
}

int CALL(pulley)(ptrdiff_t n, const double *own, ptrdiff_t own_stride, const double *frame,
                 ptrdiff_t frame_stride, const double *joint, double *length, double *by_joint,
                 double *by_own, double *bend, double *swivel, double *swivel_by_joint,
                 double *swivel_by_own)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_own[3], lane_frame[9], lane_joint[3], lane_length[1], lane_by_joint[3],
             lane_by_own[3], lane_bend[9], lane_swivel[1], lane_swivel_by_joint[3],
             lane_swivel_by_own[3];
        const int count = block_rows(first, n, row);
        gather_row(own, own_stride, 3, row, lane_own);
        gather_row(frame, frame_stride, 9, row, lane_frame);
        gather_row(joint, 3, 3, row, lane_joint);
        FN(pulley)(lane_own, lane_frame, lane_joint, lane_length, lane_by_joint, lane_by_own,
                   lane_bend, lane_swivel, lane_swivel_by_joint, lane_swivel_by_own);
        scatter_row(lane_length, 1, length, 1, row, count);
        scatter_row(lane_by_joint, 3, by_joint, 3, row, count);
        scatter_row(lane_by_own, 3, by_own, 3, row, count);
        scatter_row(lane_bend, 9, bend, 9, row, count);
        scatter_row(lane_swivel, 1, swivel, 1, row, count);
        scatter_row(lane_swivel_by_joint, 3, swivel_by_joint, 3, row, count);
        scatter_row(lane_swivel_by_own, 3, swivel_by_own, 3, row, count);
    }
    return 0;
}

int CALL(strand)(ptrdiff_t n, const double *joint, double *length, double *by_joint, double *bend)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_joint[3], lane_length[1], lane_by_joint[3], lane_bend[9];
        const int count = block_rows(first, n, row);
        gather_row(joint, 3, 3, row, lane_joint);
        FN(strand)(lane_joint, lane_length, lane_by_joint, lane_bend);
        scatter_row(lane_length, 1, length, 1, row, count);
        scatter_row(lane_by_joint, 3, by_joint, 3, row, count);
        scatter_row(lane_bend, 9, bend, 9, row, count);
    }
    return 0;
}

int CALL(slider_work)(ptrdiff_t n, const double *q, const double *numbers, ptrdiff_t numbers_stride,
                      const double *force, const double *frame, double *by_q, double *by_number)
{
    real lane_frame[9];
    for (int k = 0; k < 9; k++) lane_frame[k] = fill(frame[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_q[1], lane_numbers[16], lane_force[3], lane_by_q[1], lane_by_number[16];
        const int count = block_rows(first, n, row);
        gather_row(q, 1, 1, row, lane_q);
        gather_row(numbers, numbers_stride, 16, row, lane_numbers);
        gather_row(force, 3, 3, row, lane_force);
        FN(slider_carry)(lane_q[0], lane_numbers, lane_force, lane_frame, lane_by_q,
                         lane_by_number);
        scatter_row(lane_by_q, 1, by_q, 1, row, count);
        scatter_row(lane_by_number, 16, by_number, 16, row, count);
    }
    return 0;
}

int CALL(crank_work)(ptrdiff_t n, const double *q, const double *numbers, ptrdiff_t numbers_stride,
                     const double *force, const double *frame, double *by_q, double *by_number)
{
    real lane_frame[9];
    for (int k = 0; k < 9; k++) lane_frame[k] = fill(frame[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_q[1], lane_numbers[16], lane_force[3], lane_by_q[1], lane_by_number[16];
        const int count = block_rows(first, n, row);
        gather_row(q, 1, 1, row, lane_q);
        gather_row(numbers, numbers_stride, 16, row, lane_numbers);
        gather_row(force, 3, 3, row, lane_force);
        FN(crank_carry)(lane_q[0], lane_numbers, lane_force, lane_frame, lane_by_q, lane_by_number);
        scatter_row(lane_by_q, 1, by_q, 1, row, count);
        scatter_row(lane_by_number, 16, by_number, 16, row, count);
    }
    return 0;
}

int CALL(tpr2tps_lengths)(ptrdiff_t n, const double *size, const double *free, double *lengths)
{
    real lane_size[6];
    for (int k = 0; k < 6; k++) lane_size[k] = fill(size[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_free[4], lane_lengths[4];
        const int count = block_rows(first, n, row);
        gather_row(free, 4, 4, row, lane_free);
        FN(tpr2tps_lengths)(lane_size, lane_free, lane_lengths);
        scatter_row(lane_lengths, 4, lengths, 4, row, count);
    }
    return 0;
}

int CALL(tpr2tps_jacobian)(ptrdiff_t n, const double *size, const double *free, double *jacobian)
{
    real lane_size[6];
    for (int k = 0; k < 6; k++) lane_size[k] = fill(size[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_free[4], lane_jacobian[16];
        const int count = block_rows(first, n, row);
        gather_row(free, 4, 4, row, lane_free);
        FN(tpr2tps_jacobian)(lane_size, lane_free, lane_jacobian);
        scatter_row(lane_jacobian, 16, jacobian, 16, row, count);
    }
    return 0;
}

int CALL(exp)(ptrdiff_t n, const double *twist, double *motion)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_twist[6], lane_motion[16];
        const int count = block_rows(first, n, row);
        gather_row(twist, 6, 6, row, lane_twist);
        exp_row(lane_twist, lane_motion);
        scatter_row(lane_motion, 16, motion, 16, row, count);
    }
    return 0;
}

int CALL(log)(ptrdiff_t n, const double *motion, double *twist)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_motion[12], lane_twist[6];
        const int count = block_rows(first, n, row);
        gather_row(motion, 16, 12, row, lane_motion);
        log_row(lane_motion, lane_twist);
        scatter_row(lane_twist, 6, twist, 6, row, count);
    }
    return 0;
}

int CALL(adjoint)(ptrdiff_t n, const double *motion, double *adjoint)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_motion[12], lane_adjoint[36];
        const int count = block_rows(first, n, row);
        gather_row(motion, 16, 12, row, lane_motion);
        adjoint_row(lane_motion, lane_adjoint);
        scatter_row(lane_adjoint, 36, adjoint, 36, row, count);
    }
    return 0;
}

int CALL(motion_pose)(ptrdiff_t n, const double *motion, double *pose)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_motion[12], lane_pose[6];
        const int count = block_rows(first, n, row);
        gather_row(motion, 16, 12, row, lane_motion);
        motion_pose_row(lane_motion, lane_pose);
        scatter_row(lane_pose, 6, pose, 6, row, count);
    }
    return 0;
}

int CALL(exp_jacobian)(ptrdiff_t n, const double *twist, double *jacobian)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_twist[6], lane_jacobian[36];
        const int count = block_rows(first, n, row);
        gather_row(twist, 6, 6, row, lane_twist);
        exp_jacobian_row(lane_twist, lane_jacobian);
        scatter_row(lane_jacobian, 36, jacobian, 36, row, count);
    }
    return 0;
}

int CALL(log_jacobian)(ptrdiff_t n, const double *twist, double *jacobian)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_twist[6], lane_jacobian[36];
        const int count = block_rows(first, n, row);
        gather_row(twist, 6, 6, row, lane_twist);
        log_jacobian_row(lane_twist, lane_jacobian);
        scatter_row(lane_jacobian, 36, jacobian, 36, row, count);
    }
    return 0;
}

int CALL(joint_motions)(ptrdiff_t n, const double *error, const double *point, double *motion)
{
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_error[6], lane_point[3], lane_motion[16];
        const int count = block_rows(first, n, row);
        gather_row(error, 6, 6, row, lane_error);
        gather_row(point, 3, 3, row, lane_point);
        joint_motion_row(lane_error, lane_point, lane_motion);
        scatter_row(lane_motion, 16, motion, 16, row, count);
    }
    return 0;
}
