#include "libvio/recursive/errors_in_variables.h"

#include <numeric>

#include "libvio/recursive/transpose.h"

namespace vio {

using Eigen::MatrixXd;

namespace {

constexpr int kSize = static_cast<int>(CoreKind::inertial);

}  // namespace

ErrorsInVariables::ErrorsInVariables()
    : C_(MatrixXd::Zero(kSize, kSize)),
      transition_(CoreMatrix::Identity(kSize, kSize)),
      coupling_(CoreMatrix::Zero(kSize, kSize)) {}

void ErrorsInVariables::propagate(const CoreMatrix& transition, const CoreMatrix& noise,
                                  const CoreMatrix& P) {
    // What was read is a change of position and velocity. Its errors: those of attitude and biases,
    // and the readings' noise.
    CoreMatrix M = transition;
    M.middleRows<3>(kRotation).setZero();
    M.bottomRows(kSize - kGyroBias).setZero();
    M.middleCols<6>(kPosition).setZero();
    auto own = C_.topLeftCorner(kSize, kSize);
    own = ((transition * own + M * P) * transition.transpose()).eval();
    own.middleRows<6>(kPosition) += noise.middleRows<6>(kPosition);
    coupling_ = (transition * coupling_ + M * transition_).eval();
    transition_ = (transition * transition_).eval();
}

void ErrorsInVariables::update_core(const CoreMatrix& reduction) {
    auto own = C_.topLeftCorner(kSize, kSize);
    own = (reduction * own * reduction.transpose()).eval();
    coupling_ = (reduction * coupling_).eval();
    transition_ = (reduction * transition_).eval();
}

void ErrorsInVariables::settle(const blas::ConstMatrix& P) {
    const Eigen::Index rest = C_.rows() - kSize;
    auto C_cr = C_.topRightCorner(kSize, rest);
    auto C_rc = C_.bottomLeftCorner(rest, kSize);
    MatrixXd before = C_rc, after = MatrixXd::Zero(rest, kSize);
    blas::add_product(1, before, transition_, after);
    C_rc = after;
    transpose(C_cr, before);
    after.setZero();
    blas::add_product(1, before, transition_, after);
    blas::add_product(1, P, coupling_, after);
    transpose(after, C_cr);
    transition_.setIdentity();
    coupling_.setZero();
}

void ErrorsInVariables::clone(int at, bool inserted) {
    if (inserted) {
        std::vector<int> errors(static_cast<std::size_t>(C_.rows()) + 6);
        std::iota(errors.begin(), errors.begin() + at, 0);
        std::iota(errors.begin() + at, errors.begin() + at + 6, 0);
        std::iota(errors.begin() + at + 6, errors.end(), at);
        choose(errors);
        return;
    }
    C_.middleRows<6>(at) = C_.topRows<6>().eval();
    C_.middleCols<6>(at) = C_.leftCols<6>().eval();
}

void ErrorsInVariables::choose(const std::vector<int>& errors) {
    C_ = C_(errors, errors).eval();
}

void ErrorsInVariables::augment(int first, const MatrixXd& G) {
    const Eigen::Index n = C_.rows(), added = G.rows();
    C_.conservativeResize(n + added, n + added);
    C_.bottomLeftCorner(added, n) = G * C_.block(first, 0, G.cols(), n);
    C_.rightCols(added) = C_.middleCols(first, G.cols()) * G.transpose();
}

void ErrorsInVariables::add(int at, int by, const Vector6d& rate) {
    C_.middleRows<6>(at) += rate * C_.row(by);
    C_.middleCols<6>(at) += C_.col(by) * rate.transpose();
}

void ErrorsInVariables::reanchor(int at, int from, int to, int mount, int mounted,
                                 const MovedPoint& J) {
    const auto J_camera = J.J_camera.leftCols(mounted);
    const MatrixXd rows = J.J_point.lazyProduct(C_.middleRows<3>(at)) +
                          J.J_from.lazyProduct(C_.middleRows<6>(from)) +
                          J.J_to.lazyProduct(C_.middleRows<6>(to)) +
                          J_camera.lazyProduct(C_.middleRows(mount, mounted));
    C_.middleRows<3>(at) = rows;
    const MatrixXd columns = C_.middleCols<3>(at).lazyProduct(J.J_point.transpose()) +
                             C_.middleCols<6>(from).lazyProduct(J.J_from.transpose()) +
                             C_.middleCols<6>(to).lazyProduct(J.J_to.transpose()) +
                             C_.middleCols(mount, mounted).lazyProduct(J_camera.transpose());
    C_.middleCols<3>(at) = columns;
}

void ErrorsInVariables::carry(int at, const Carrier& T) {
    carry_columns(C_.middleCols(at, T.rows()), T);
    carry_rows(C_.middleRows(at, T.rows()), T);
}

// (I - K H) C (I - K H)^T.
void ErrorsInVariables::update(const blas::ConstMatrix& gain, const TimesHt& times_Ht) {
    MatrixXd C_transposed(C_.cols(), C_.rows());
    transpose(C_, C_transposed);
    blas::add_product(-1, gain, times_Ht(C_transposed), C_);
    blas::add_product(-1, times_Ht(C_), gain, C_);
}

}  // namespace vio
