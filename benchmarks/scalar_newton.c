/* Forward kinematics of a 6-UPS as a textbook has it, for comparison: one row at a time, Newton on the
 * leg lengths in x y z and Euler angles, the C library's sin and cos, Gaussian elimination with row
 * exchanges.
 *
 * base, platform (6 x 3) and offset (6) in mm; q (n x 6); all rows start at `guess` (x y z in mm,
 * angles in rad) and are solved until every length is met to `closed` mm. Returns the iterations of
 * all rows, or -1 where one does not converge in 50. */
#include <math.h>
#include <stddef.h>

static void frame(const double *pose, double R[3][3], double D[3][3][3])
{
    const double ca = cos(pose[3]), sa = sin(pose[3]), cb = cos(pose[4]), sb = sin(pose[4]);
    const double cg = cos(pose[5]), sg = sin(pose[5]);
    const double r[3][3] = {{cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa},
                            {sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa},
                            {-sb, cb * sa, cb * ca}};
    const double by_beta[3][3] = {{-cg * sb, cg * cb * sa, cg * cb * ca},
                                  {-sg * sb, sg * cb * sa, sg * cb * ca},
                                  {-cb, -sb * sa, -sb * ca}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            R[i][j] = r[i][j];
            D[1][i][j] = by_beta[i][j];
        }
    for (int i = 0; i < 3; i++) {
        D[0][i][0] = 0.0;
        D[0][i][1] = r[i][2];
        D[0][i][2] = -r[i][1];
        D[2][0][i] = -r[1][i];
        D[2][1][i] = r[0][i];
        D[2][2][i] = 0.0;
    }
}

static void eliminate(double A[6][6], double *b)
{
    for (int c = 0; c < 6; c++) {
        int pivot = c;
        for (int i = c + 1; i < 6; i++)
            if (fabs(A[i][c]) > fabs(A[pivot][c])) pivot = i;
        if (pivot != c) {
            for (int j = c; j < 6; j++) {
                const double swapped = A[c][j];
                A[c][j] = A[pivot][j];
                A[pivot][j] = swapped;
            }
            const double swapped = b[c];
            b[c] = b[pivot];
            b[pivot] = swapped;
        }
        for (int i = c + 1; i < 6; i++) {
            const double factor = A[i][c] / A[c][c];
            for (int j = c + 1; j < 6; j++) A[i][j] -= factor * A[c][j];
            b[i] -= factor * b[c];
        }
    }
    for (int i = 5; i >= 0; i--) {
        for (int j = i + 1; j < 6; j++) b[i] -= A[i][j] * b[j];
        b[i] /= A[i][i];
    }
}

long scalar_newton(ptrdiff_t n, const double *base, const double *platform, const double *offset,
                   const double *q, const double *guess, double closed, double *poses)
{
    long total = 0;
    for (ptrdiff_t row = 0; row < n; row++) {
        double *pose = poses + 6 * row;
        int k = 0;
        for (int j = 0; j < 6; j++) pose[j] = guess[j];
        for (;; k++) {
            double R[3][3], D[3][3][3], A[6][6], missed[6], worst = 0.0;
            if (k == 50) return -1;
            frame(pose, R, D);
            for (int i = 0; i < 6; i++) {
                const double *b = platform + 3 * i, *a = base + 3 * i;
                double d[3], length = 0.0;
                for (int j = 0; j < 3; j++) {
                    d[j] = pose[j] + R[j][0] * b[0] + R[j][1] * b[1] + R[j][2] * b[2] - a[j];
                    length += d[j] * d[j];
                }
                length = sqrt(length);
                for (int j = 0; j < 3; j++) A[i][j] = d[j] / length;
                for (int t = 0; t < 3; t++) {
                    A[i][3 + t] = 0.0;
                    for (int j = 0; j < 3; j++)
                        A[i][3 + t] += A[i][j] * (D[t][j][0] * b[0] + D[t][j][1] * b[1] + D[t][j][2] * b[2]);
                }
                missed[i] = length - (q[6 * row + i] + offset[i]);
                if (fabs(missed[i]) > worst) worst = fabs(missed[i]);
            }
            if (worst < closed) break;
            eliminate(A, missed);
            for (int j = 0; j < 6; j++) pose[j] -= missed[j];
        }
        total += k;
    }
    return total;
}
