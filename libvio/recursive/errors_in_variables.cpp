#include "libvio/recursive/errors_in_variables.h"

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

void ErrorsInVariables::settle(const Eigen::Ref<const MatrixXd>& P) {
    const Eigen::Index rest = C_.rows() - kSize;
    auto C_cr = C_.topRightCorner(kSize, rest);
    auto C_rc = C_.bottomLeftCorner(rest, kSize);
    C_cr = (transition_ * C_cr + coupling_ * P).eval();
    C_rc = (C_rc * transition_.transpose()).eval();
    transition_.setIdentity();
    coupling_.setZero();
}

void ErrorsInVariables::clone(int at) {
    if (at == C_.rows()) C_.conservativeResize(at + 6, at + 6);
    C_.middleRows<6>(at) = C_.topRows<6>().eval();
    C_.middleCols<6>(at) = C_.leftCols<6>().eval();
}

void ErrorsInVariables::carry(int at, const Carrier& T) {
    carry_columns(C_.middleCols(at, T.rows()), T);
    carry_rows(C_.middleRows(at, T.rows()), T);
}

void ErrorsInVariables::update(const blas::ConstMatrix& W, const blas::ConstMatrix& X) {
    K_.setZero(C_.rows(), C_.rows());
    blas::add_product(1, W, X, K_);
    copy_ = C_.transpose();
    blas::add_product(-1, K_, copy_, C_);
    copy_ = C_;
    blas::add_product(-1, copy_, K_, C_);
}

}  // namespace vio
