#include "libvio/check/rotation_agreement.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/median.h"
#include "libvio/check/axes.h"
#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr int kFewestPairs = 15;
constexpr double kWorthRefining = 0.3;  // share of the rotation explained
constexpr double kStep = 0.004;         // [s] of the search for the time offset
constexpr double kOutlier = 4;          // times the median's sigma
constexpr double kLongestTurn = 0.7;    // [rad] between two images: beyond, x is no longer linear
// A local minimum near zero is believed before a distant one that is no better than this: periodic
// motion fits itself a period later almost as well.
constexpr double kNearlyAsGood = 1.3;
constexpr double kImageNoise = 1e-3;  // [rad]: where images agree better, it is by chance
constexpr double kBias = 0.1;         // [rad/s]: of a gyro, about
// Errors of neighbouring rotations of a stretch go together: as if one in four were independent.
constexpr double kAlike = 4;
constexpr double kTurnKnown = 0.1;   // [rad] sigma up to which a turn counts as known
constexpr double kNearAxes = 0.35;   // of two matrices, Frobenius: about 14 degrees
constexpr double kGyroScale = 0.01;  // to which a gyro's scale is believed

// The gyro's angular velocity, integrated from the first reading to any time.
class GyroIntegral {
 public:
    GyroIntegral(const std::vector<ImuReading>& readings, const Matrix3d& R_C_I) {
        Vector3d sum = Vector3d::Zero();
        for (std::size_t i = 0; i < readings.size(); ++i) {
            if (i > 0)
                sum += 0.5 * to_seconds(readings[i].t - readings[i - 1].t) * R_C_I *
                       (readings[i].gyro + readings[i - 1].gyro);
            times_.push_back(readings[i].t);
            sums_.push_back(sum);
        }
    }

    bool covers(TimeNs begin, TimeNs end) const {
        return !times_.empty() && times_.front() <= begin && end <= times_.back();
    }

    Vector3d between(TimeNs begin, TimeNs end) const { return at(end) - at(begin); }

 private:
    // Linear between readings: an error of second order in their interval.
    Vector3d at(TimeNs t) const {
        const auto after = std::lower_bound(times_.begin(), times_.end(), t);
        const auto i = static_cast<std::size_t>(after - times_.begin());
        if (*after == t) return sums_[i];
        const double share = to_seconds(t - times_[i - 1]) / to_seconds(times_[i] - times_[i - 1]);
        return sums_[i - 1] + share * (sums_[i] - sums_[i - 1]);
    }

    std::vector<TimeNs> times_;
    std::vector<Vector3d> sums_;
};

struct Pair {
    TimeNs t1, t2;
    Vector3d y;
    Matrix3d W;  // information
    double T() const { return to_seconds(t2 - t1); }
};

using Vector4d = Eigen::Vector4d;
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;
using Matrix34d = Eigen::Matrix<double, 3, 4>;

std::vector<Vector3d> gyro_rotations(const std::vector<Pair>& pairs, const GyroIntegral& gyro,
                                     double offset) {
    const TimeNs shift = from_seconds(offset);
    std::vector<Vector3d> x;
    for (const Pair& pair : pairs) x.push_back(gyro.between(pair.t1 + shift, pair.t2 + shift));
    return x;
}

// Weighted least squares for (M, c), whatever the axes.
struct FreeFit {
    Matrix34d Mc;
    double left = 0;  // weighted squares

    FreeFit(const std::vector<Pair>& pairs, const std::vector<Vector3d>& x) {
        Matrix12d N = Matrix12d::Zero();
        Vector12d b = Vector12d::Zero();
        double squares = 0;
        for (std::size_t i = 0; i < pairs.size(); ++i) {
            const Vector4d z(x[i].x(), x[i].y(), x[i].z(), pairs[i].T());
            const Vector3d Wy = pairs[i].W * pairs[i].y;
            squares += pairs[i].y.dot(Wy);
            for (int j = 0; j < 4; ++j) {
                b.segment<3>(3 * j) += z[j] * Wy;
                for (int k = 0; k < 4; ++k) N.block<3, 3>(3 * j, 3 * k) += z[j] * z[k] * pairs[i].W;
            }
        }
        const Matrix12d regular = N + 1e-9 * N.trace() * Matrix12d::Identity();
        const Vector12d solution = regular.ldlt().solve(b);
        Mc = Eigen::Map<const Matrix34d>(solution.data());
        left = squares - 2 * solution.dot(b) + solution.dot(N * solution);
    }

    Vector3d residual(const Pair& pair, const Vector3d& x) const {
        return pair.y - Mc * Vector4d(x.x(), x.y(), x.z(), pair.T());
    }
};

struct Shift {
    double offset = 0, sigma = 0;
};

// The shift whose best map leaves the least.
Shift find_shift(const std::vector<Pair>& pairs, const GyroIntegral& gyro, double search) {
    const int steps = static_cast<int>(std::floor(search / kStep));
    std::vector<double> curve;
    for (int i = -steps; i <= steps; ++i)
        curve.push_back(FreeFit(pairs, gyro_rotations(pairs, gyro, i * kStep)).left);
    const double least = *std::min_element(curve.begin(), curve.end());
    int best = -1;
    for (int i = 1; i + 1 < static_cast<int>(curve.size()); ++i) {
        const bool minimum = curve[i] <= curve[i - 1] && curve[i] <= curve[i + 1];
        if (!minimum || curve[i] > kNearlyAsGood * least) continue;
        if (best < 0 || std::abs(i - steps) < std::abs(best - steps)) best = i;
    }
    if (best < 0) return {0, search};
    const double a = curve[best - 1], b = curve[best], c = curve[best + 1];
    const double curvature = (a - 2 * b + c) / (kStep * kStep);
    Shift shift{(best - steps) * kStep, search};
    if (!(curvature > 0)) return shift;
    shift.offset -= (c - a) / (2 * kStep * curvature);
    const double variance =
        kAlike * b / std::max(1.0, 3.0 * static_cast<double>(pairs.size()) - 13);
    shift.sigma = std::sqrt(2 * variance / curvature);
    return shift;
}

// Leaves out the pairs that disagree with the best map. False if there are none.
bool leave_out_outliers(std::vector<Pair>& pairs, const GyroIntegral& gyro, double offset) {
    const std::vector<Vector3d> x = gyro_rotations(pairs, gyro, offset);
    const FreeFit fit(pairs, x);
    std::vector<double> squares;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        const Vector3d r = fit.residual(pairs[i], x[i]);
        squares.push_back(r.dot(pairs[i].W * r));
    }
    // The median of chi-square with three degrees of freedom is 2.37.
    const double limit = kOutlier * kOutlier * 3 * median(squares) / 2.37;
    std::vector<Pair> good;
    for (std::size_t i = 0; i < pairs.size(); ++i)
        if (squares[i] <= limit) good.push_back(pairs[i]);
    const bool any = good.size() < pairs.size();
    if (good.size() >= kFewestPairs) pairs = std::move(good);
    return any;
}

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Matrix37d = Eigen::Matrix<double, 3, 7>;

// y = gain R x + c T by Gauss-Newton over (R, gain, c).
struct TurnFit {
    Matrix3d R;
    double gain = 0;
    Vector3d c = Vector3d::Zero();
    double left = 0;
    Matrix7d information;

    TurnFit(const std::vector<Pair>& pairs, const std::vector<Vector3d>& x, const Matrix3d& start)
        : R(start) {
        for (int iteration = 0; iteration < 12; ++iteration) {
            const bool linear = iteration == 0;  // gain and c first: they may be far off
            Vector7d b = linearise(pairs, x);
            Matrix7d N = information;
            if (linear) {
                N.topLeftCorner<3, 3>().diagonal().array() += 1e12 * N.trace();
            } else {
                // Keeps the turn about an axis that nothing shows as it is.
                N.diagonal().array() += 1e-6 * N.diagonal().array() + 1e-9;
            }
            const Vector7d d = N.ldlt().solve(b);
            if (!d.allFinite()) break;
            const double turn = std::min(1.0, 0.3 / std::max(1e-9, d.head<3>().norm()));
            R = so3::normalized(R * so3::exp(turn * d.head<3>()));
            gain += d[3];
            c += d.tail<3>();
            if (!linear && d.head<3>().norm() < 1e-7) break;
        }
        linearise(pairs, x);
    }

 private:
    Vector7d linearise(const std::vector<Pair>& pairs, const std::vector<Vector3d>& x) {
        information.setZero();
        left = 0;
        Vector7d b = Vector7d::Zero();
        for (std::size_t i = 0; i < pairs.size(); ++i) {
            const Vector3d Rx = R * x[i];
            const Vector3d r = pairs[i].y - gain * Rx - c * pairs[i].T();
            Matrix37d J;
            J << -gain * R * so3::skew(x[i]), Rx, pairs[i].T() * Matrix3d::Identity();
            information += J.transpose() * pairs[i].W * J;
            b += J.transpose() * pairs[i].W * r;
            left += r.dot(pairs[i].W * r);
        }
        // Even rotation is not to pass for a bias.
        information.bottomRightCorner<3, 3>().diagonal().array() += 1 / (kBias * kBias);
        b.tail<3>() -= c / (kBias * kBias);
        return b;
    }
};

// The best turn: the smallest that fits, a mirror image only if no rotation does.
TurnFit best_turn(const std::vector<Pair>& pairs, const std::vector<Vector3d>& x) {
    TurnFit best(pairs, x, Matrix3d::Identity());
    for (const Matrix3d& start : signed_permutations(true)) {
        const TurnFit fit(pairs, x, start);
        const bool was_mirrored = best.gain < 0, is_mirrored = fit.gain < 0;
        const double better = was_mirrored == is_mirrored ? 0.7 : is_mirrored ? 0.5 : 2;
        if (fit.left < better * best.left) best = fit;
    }
    return best;
}

void judge_turn(const TurnFit& fit, const Matrix3d& R_C_I, double variance, RotationAgreement& a) {
    Matrix7d regular = fit.information / variance;
    regular.diagonal().array() += 1e-9;
    const Matrix7d covariance = regular.inverse();
    const Matrix3d turn = covariance.topLeftCorner<3, 3>();
    a.mirrored = fit.gain < 0;
    a.R = fit.R;
    a.gain = std::abs(fit.gain);
    a.gain_sigma = std::sqrt(covariance(3, 3));
    const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(turn);
    Vector3d known = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
        const double sigma = std::sqrt(std::max(0.0, solver.eigenvalues()[i]));
        if (sigma > kTurnKnown) continue;
        ++a.axes;
        a.angle_sigma = sigma;  // they increase
        known += solver.eigenvectors().col(i).dot(so3::log(fit.R)) * solver.eigenvectors().col(i);
    }
    a.angle = known.norm();
    const Matrix3d axes = a.mirrored ? Matrix3d(-a.R) : a.R;
    for (const Matrix3d& P : signed_permutations(false)) {
        if (P.isIdentity()) continue;
        if ((axes - P).norm() < kNearAxes) a.camera_axes = P;
        if ((R_C_I.transpose() * axes * R_C_I - P).norm() < kNearAxes) a.imu_axes = P;
    }
}

// y = diag(across, across, along) R x + c T.
void judge_focal_length(const std::vector<Pair>& pairs, const std::vector<Vector3d>& x,
                        const TurnFit& fit, double variance, RotationAgreement& a) {
    using Matrix35d = Eigen::Matrix<double, 3, 5>;
    using Vector5d = Eigen::Matrix<double, 5, 1>;
    using Matrix5d = Eigen::Matrix<double, 5, 5>;
    Matrix5d N = Matrix5d::Zero();
    Vector5d b = Vector5d::Zero();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        const Vector3d Rx = fit.R * x[i];
        Matrix35d J;
        J << Vector3d(Rx.x(), Rx.y(), 0), Vector3d(0, 0, Rx.z()),
            pairs[i].T() * Matrix3d::Identity();
        N += J.transpose() * pairs[i].W * J / variance;
        b += J.transpose() * pairs[i].W * pairs[i].y / variance;
    }
    N.bottomRightCorner<3, 3>().diagonal().array() += 1 / (kBias * kBias);
    // Along the axis, where nothing turns about it, a gyro is believed.
    N(1, 1) += 1 / (kGyroScale * kGyroScale);
    b(1) += 1 / (kGyroScale * kGyroScale);
    const Matrix5d covariance = N.inverse();
    const Vector5d gains = covariance * b;
    a.focal_ratio = gains[0] / gains[1];
    a.focal_sigma =
        std::sqrt(std::max(0.0, covariance(0, 0) + covariance(1, 1) - 2 * covariance(0, 1)));
}

std::optional<RotationAgreement> compare(const std::vector<ImageRotation>& rotations,
                                         const GyroIntegral& gyro, const Rig& rig, double search) {
    const TimeNs offset = from_seconds(rig.time_offset), margin = from_seconds(search);
    std::vector<Pair> pairs;
    for (const ImageRotation& r : rotations)
        if (gyro.covers(r.t1 + offset - margin, r.t2 + offset + margin) &&
            r.rotation.norm() < kLongestTurn)
            pairs.push_back({r.t1 + offset, r.t2 + offset, r.rotation, r.covariance.inverse()});
    if (static_cast<int>(pairs.size()) < kFewestPairs) return std::nullopt;
    Shift shift = find_shift(pairs, gyro, search);
    for (int i = 0; i < 5 && leave_out_outliers(pairs, gyro, shift.offset); ++i)
        shift = find_shift(pairs, gyro, search);

    const std::vector<Vector3d> x = gyro_rotations(pairs, gyro, shift.offset);
    const FreeFit free(pairs, x);
    RotationAgreement a;
    a.pairs = static_cast<int>(pairs.size());
    double rates = 0, squares = 0, errors = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        rates += pairs[i].y.squaredNorm() / (pairs[i].T() * pairs[i].T());
        squares += pairs[i].y.dot(pairs[i].W * pairs[i].y);
        errors += free.residual(pairs[i], x[i]).squaredNorm();
    }
    a.image_rate = std::sqrt(rates / a.pairs);
    a.noise = std::sqrt(errors / (3 * a.pairs));
    const double variance = kAlike * std::max(1.0, free.left / std::max(1.0, 3.0 * a.pairs - 13));
    a.explained = squares > 0 ? 1 - free.left / squares : 0;
    a.offset = shift.offset;
    a.offset_sigma = shift.sigma;
    const TurnFit turn = best_turn(pairs, x);
    a.drift = turn.c;
    judge_turn(turn, rig.T_I_C().R.transpose(), variance, a);
    if (!a.mirrored) judge_focal_length(pairs, x, turn, variance, a);
    return a;
}

}  // namespace

std::optional<RotationAgreement> compare_rotations(const ImageRotations& images,
                                                   const std::vector<ImuReading>& readings,
                                                   const Rig& rig, int most_pairs, double search) {
    const GyroIntegral gyro(readings, rig.T_I_C().R.transpose());
    const auto coarse = compare(images.from_pairs(*rig.camera, most_pairs), gyro, rig, search);
    if (!coarse || coarse->axes == 0 || coarse->explained < kWorthRefining) return coarse;
    const auto predict = [&](TimeNs t1, TimeNs t2) -> std::optional<Matrix3d> {
        const TimeNs shift = from_seconds(rig.time_offset + coarse->offset);
        if (!gyro.covers(t1 + shift, t2 + shift)) return std::nullopt;
        const double gain = coarse->mirrored ? -coarse->gain : coarse->gain;
        return so3::exp(gain * coarse->R * gyro.between(t1 + shift, t2 + shift) +
                        to_seconds(t2 - t1) * coarse->drift);
    };
    const auto fine =
        compare(images.from_stretches(*rig.camera, most_pairs, predict), gyro, rig, search);
    return fine && fine->explained > coarse->explained ? fine : coarse;
}

}  // namespace vio
