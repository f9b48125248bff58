// Dense products on BLAS equal Eigen's.
#include <gtest/gtest.h>

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
