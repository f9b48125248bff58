// Dense products on BLAS equal Eigen's.
#include <gtest/gtest.h>

#include <cmath>

#include "libvio/base/blas.h"

namespace vio {
namespace {

using Eigen::MatrixXd;

TEST(Blas, FactorizesAPanelAndDividesByTheFactor) {
    constexpr int kSquare = 130, kBelow = 17;  // more than one block of columns
    const MatrixXd B = MatrixXd::Random(kSquare + kBelow, kSquare);
    MatrixXd A = B * B.topRows(kSquare).transpose();
    A.topRows(kSquare).diagonal().array() += 1;
    const MatrixXd square = A.topRows(kSquare);
    MatrixXd panel = A;
    ASSERT_TRUE(blas::factorize(panel));
    const MatrixXd L = square.llt().matrixL();
    EXPECT_LT((MatrixXd(panel.topRows(kSquare).triangularView<Eigen::Lower>()) - L).norm(),
              1e-10 * L.norm());
    EXPECT_LT((panel.bottomRows(kBelow) * L.transpose() - A.bottomRows(kBelow)).norm(),
              1e-10 * A.norm());
    // The upper triangle is left alone.
    EXPECT_EQ(panel(3, 100), A(3, 100));
    MatrixXd rows = A.bottomRows(kBelow);
    blas::divide(panel.topRows(kSquare), rows);
    EXPECT_LT((rows - panel.bottomRows(kBelow)).norm(), 1e-10 * rows.norm());
    Eigen::VectorXd x = Eigen::VectorXd::Random(kSquare);
    auto factor = panel.topRows(kSquare);
    ASSERT_TRUE(blas::update_factor(factor, x, 1));
    MatrixXd updated = factor.triangularView<Eigen::Lower>();
    EXPECT_LT((updated * updated.transpose() - square - x * x.transpose()).norm(),
              1e-12 * square.norm());
    ASSERT_TRUE(blas::update_factor(factor, x, -1));
    updated = factor.triangularView<Eigen::Lower>();
    EXPECT_LT((updated - L).norm(), 1e-12 * L.norm());
    EXPECT_FALSE(blas::update_factor(factor, 2 * L.col(0), -1));
    EXPECT_EQ(panel(3, 100), A(3, 100));
    A(100, 100) = -1;
    EXPECT_FALSE(blas::factorize(A));
}

// The upper triangle is neither read nor written.
TEST(Blas, SymmetricByTheLowerTriangle) {
    constexpr int kSize = 21;
    const MatrixXd B = MatrixXd::Random(kSize, kSize), square = B + B.transpose();
    const Eigen::VectorXd x = Eigen::VectorXd::Random(kSize), y = Eigen::VectorXd::Random(kSize);
    MatrixXd larger = MatrixXd::Constant(kSize + 5, kSize + 5, std::nan(""));
    auto A = larger.block(2, 3, kSize, kSize);
    A.triangularView<Eigen::Lower>() = square;
    EXPECT_LT((blas::symmetric_times(A, x) - square * x).norm(), 1e-12);
    blas::add_square(-0.5, x, A);
    blas::add_pair(x, y, A);
    const MatrixXd expected =
        square - 0.5 * x * x.transpose() + x * y.transpose() + y * x.transpose();
    EXPECT_LT((MatrixXd(A.selfadjointView<Eigen::Lower>()) - expected).norm(), 1e-12);
    EXPECT_TRUE(std::isnan(A(0, 1)));
}

TEST(Blas, ProductsOfBlocks) {
    const MatrixXd all = MatrixXd::Random(40, 30);
    const auto A = all.block(2, 3, 20, 7), B = all.block(11, 19, 9, 7);
    MatrixXd C = MatrixXd::Random(25, 20), expected = C;
    expected.block(1, 2, 20, 9) += 0.5 * A * B.transpose();
    blas::add_product(0.5, A, B, C.block(1, 2, 20, 9));
    EXPECT_LT((C - expected).norm(), 1e-12);
    const MatrixXd difference = C.topRows(20) - A * A.transpose();
    expected.topRows(20).triangularView<Eigen::Lower>() = difference;
    blas::subtract_square(A, C.topRows(20));
    EXPECT_LT((C - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace vio
