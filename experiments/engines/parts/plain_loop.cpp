// Extremes of sets of R grips by plain loops: forces of the grips, then what loads mean, summed.
// index (S, R): held nodes; flexibility (l, l), dead (l,): at loads, three to a node; edge
// (l + 1, E), node (3, l + 1, N), moment (l + 1, 3G): what loads mean, the weight's row last;
// out (S, 5): largest tension, displacement, moment and force, and the least scaled pivot.
#include <algorithm>
#include <cmath>
#include <cstdint>

template <int R>
static void run(int64_t sets, const int64_t *index, int64_t loads, const double *flexibility,
                const double *dead, int64_t edges, const double *edge, int64_t nodes,
                const double *node, int64_t ends, const double *moment, double *out) {
    constexpr int K = 3 * R;
    for (int64_t s = 0; s < sets; s++) {
        int64_t row[K + 1];
        double matrix[K][K], force[K + 1], pivot[K], own[K], least = 1e300;
        for (int i = 0; i < K; i++) row[i] = 3 * index[s * R + i / 3] + i % 3;
        row[K] = loads;
        for (int i = 0; i < K; i++) {
            for (int j = 0; j <= i; j++) matrix[i][j] = flexibility[row[i] * loads + row[j]];
            own[i] = matrix[i][i];
            force[i] = -dead[row[i]];
        }
        for (int j = 0; j < K; j++) {
            double left[K], value = matrix[j][j];
            for (int k = 0; k < j; k++) {
                left[k] = matrix[j][k] * pivot[k];
                value -= matrix[j][k] * left[k];
            }
            pivot[j] = value;
            least = std::min(least, value / own[j]);
            for (int i = j + 1; i < K; i++) {
                double t = matrix[i][j];
                for (int k = 0; k < j; k++) t -= matrix[i][k] * left[k];
                matrix[i][j] = t / value;
            }
        }
        for (int i = 0; i < K; i++)
            for (int k = 0; k < i; k++) force[i] -= matrix[i][k] * force[k];
        for (int i = 0; i < K; i++) force[i] /= pivot[i];
        for (int i = K - 1; i >= 0; i--)
            for (int k = i + 1; k < K; k++) force[i] -= matrix[k][i] * force[k];
        force[K] = 1.0;
        double pull = 0, tension = -1e300, shift = 0, turn = 0;
        for (int i = 0; i < K; i += 3)
            pull = std::max(pull, force[i] * force[i] + force[i + 1] * force[i + 1] +
                                      force[i + 2] * force[i + 2]);
#pragma omp simd reduction(max : tension)
        for (int64_t e = 0; e < edges; e++) {
            double t = 0;
            for (int i = 0; i <= K; i++) t += force[i] * edge[row[i] * edges + e];
            tension = std::max(tension, t);
        }
        const int64_t axis = (loads + 1) * nodes;
#pragma omp simd reduction(max : shift)
        for (int64_t n = 0; n < nodes; n++) {
            double x = 0, y = 0, z = 0;
            for (int i = 0; i <= K; i++) {
                const double *at = node + row[i] * nodes + n;
                x += force[i] * at[0];
                y += force[i] * at[axis];
                z += force[i] * at[2 * axis];
            }
            shift = std::max(shift, x * x + y * y + z * z);
        }
        for (int64_t g = 0; g < ends; g++) {
            double size = 0;
            for (int c = 3 * g; c < 3 * g + 3; c++) {
                double t = 0;
                for (int i = 0; i <= K; i++) t += force[i] * moment[row[i] * 3 * ends + c];
                size += t * t;
            }
            turn = std::max(turn, size);
        }
        double *to = out + 5 * s;
        to[0] = tension;
        to[1] = std::sqrt(shift);
        to[2] = std::sqrt(turn);
        to[3] = std::sqrt(pull);
        to[4] = least;
    }
}

extern "C" void extremes_of_three(int64_t sets, const int64_t *index, int64_t loads,
                                  const double *flexibility, const double *dead, int64_t edges,
                                  const double *edge, int64_t nodes, const double *node,
                                  int64_t ends, const double *moment, double *out) {
    run<3>(sets, index, loads, flexibility, dead, edges, edge, nodes, node, ends, moment, out);
}
