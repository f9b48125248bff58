#include <gtest/gtest.h>

#include <limits>

#include "libvio/recursive/carrier.h"

namespace vio {
namespace {

using Eigen::MatrixXd;

// Against the whole T, in part of a larger matrix, whose rest stays.
TEST(Carrier, IsWhatItsWholeMatrixDoes) {
    for (const int n : {6, 9, 15})
        for (int count = 1; count <= 18; ++count) {
            const Carrier T = Carrier::Random(n, 3);
            MatrixXd whole = MatrixXd::Identity(n, n);
            whole.leftCols<3>() = T;
            MatrixXd columns = MatrixXd::Random(count + 3, n + 4), rows = columns.transpose(),
                     expected = columns;
            expected.block(1, 2, count, n) = columns.block(1, 2, count, n) * whole.transpose();
            carry_columns(columns.block(1, 2, count, n), T);
            EXPECT_LT((columns - expected).norm(), 1e-13) << n << ' ' << count;
            carry_rows(rows.block(2, 1, n, count), T);
            EXPECT_LT((rows - expected.transpose()).norm(), 1e-13) << n << ' ' << count;
        }
}

}  // namespace
}  // namespace vio
