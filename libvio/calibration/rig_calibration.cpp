#include "libvio/calibration/rig_calibration.h"

#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/batch/normal_equations.h"
#include "libvio/batch/objective.h"
#include "libvio/batch/start.h"
#include "libvio/camera/intrinsics.h"

namespace vio {

using namespace batch;

namespace {

Rig moved(const Rig& rig, const RigUnknowns& unknowns, const Eigen::VectorXd& step) {
    Rig next = rig;
    if (unknowns.extrinsics) next.T_B_C = rig.T_B_I * rig.T_I_C().boxplus(Vector6d(step.head<6>()));
    if (unknowns.time_offset) next.time_offset += step(unknowns.extrinsics ? 6 : 0);
    if (const int n = unknowns.intrinsics; n > 0)
        next.camera = with_intrinsics(*rig.camera, intrinsics(*rig.camera, n) + step.tail(n));
    return next;
}

class Calibrator {
 public:
    Calibrator(const BatchProblem& problem, const BatchOptions& options,
               const RigQuestion& question, const Estimate& start)
        : problem_(problem),
          options_(options),
          unknowns_{question.extrinsics, question.time_offset, question.intrinsics} {
        now_.rig = problem.rig;
        now_.model =
            make_model(problem, options, static_cast<int>(problem.frames.size()), kFewestImages);
        now_.state = given_start(now_.model, start);
        if (now_.model.inertial && options.gravity == "magnitude")
            now_.state.gravity *= options.gravity_norm / now_.state.gravity.norm();
        trial_.model = now_.model;
        for (Place* place : {&now_, &trial_})
            place->equations = std::make_unique<NormalEquations>(
                place->model, make_layout(place->model, options), thread_count(options));
    }

    void set_sigma(double sigma_px) {
        const double factor = options_.sigma_px / sigma_px;
        for (Place* place : {&now_, &trial_})
            for (Observation& observation : place->model.observations)
                observation.sqrt_information *= factor;
        options_.sigma_px = sigma_px;
    }

    void minimize(const std::string& loss) {
        stage_ = {options_.gravity == "free", loss};
        linearize(now_);
        double lambda = 1e-6, growth = 2;
        result.converged = false;
        result.reason = "iteration limit reached";
        for (int i = 0; i < options_.max_iterations; ++i) {
            ++result.iterations;
            double predicted = 0;
            const bool tried = try_step(lambda, predicted);
            const double decrease = now_.cost - trial_.cost,
                         small = options_.cost_tolerance * now_.cost;
            const bool accepted = tried && decrease > 0;
            const bool settled = tried && predicted <= small && std::abs(decrease) <= small;
            if (accepted) {
                std::swap(now_.rig, trial_.rig);
                std::swap(now_.state, trial_.state);
                linearize(now_);
                lambda = std::max(
                    1e-12,
                    lambda * std::max(1. / 3, 1 - std::pow(2 * decrease / predicted - 1, 3)));
                growth = 2;
            }
            if (settled) {
                result.converged = true;
                result.reason = "cost no longer decreases";
                return;
            }
            if (accepted) continue;
            lambda *= growth;
            growth *= 2;
            if (lambda > 1e14) {
                result.reason = "no step decreases the cost";
                return;
            }
        }
    }

    // True if there are any new ones.
    bool drop_outliers() {
        const double limit2 = options_.outlier_sigmas * options_.outlier_sigmas;
        if (limit2 == 0) return false;
        const Objective objective(now_.model, options_, {});
        bool any = false;
        for (size_t k = 0; k < now_.model.observations.size(); ++k) {
            Observation& observation = now_.model.observations[k];
            if (!observation.active ||
                objective.observation_distance2(now_.state, observation) <= limit2)
                continue;
            observation.active = trial_.model.observations[k].active = false;
            any = true;
        }
        return any;
    }

    // Of one coordinate, over what is no outlier.
    double rms_px() const {
        const Objective objective(now_.model, options_, {});
        double sum = 0;
        int count = 0;
        for (const Observation& observation : now_.model.observations)
            if (observation.active)
                if (const auto r = objective.image_residual(now_.state, observation)) {
                    sum += r->squaredNorm();
                    count += 2;
                }
        return std::sqrt(sum / std::max(1, count));
    }

    void publish() {
        result.rig = now_.rig;
        result.sigma_px = options_.sigma_px;
        result.rms_px = rms_px();
        result.images = now_.model.frames();
        result.g_W = now_.state.gravity;
        for (int i = 0; i < now_.model.frames(); ++i) {
            const State::Frame& frame = now_.state.frames[i];
            result.T_W_C.push_back(
                {now_.model.times[i], Pose{frame.motion.R, frame.motion.p} * now_.model.T_I_C});
            result.bias.gyro += frame.bias.gyro / now_.model.frames();
            result.bias.accel += frame.bias.accel / now_.model.frames();
        }
        const Objective objective(now_.model, options_, {});
        for (const Observation& observation : now_.model.observations) {
            ++(observation.active ? result.observations : result.outliers);
            const auto r = objective.image_residual(now_.state, observation);
            result.residuals.push_back(
                {observation.frame_idx, now_.model.points[observation.point_idx].id,
                 observation.uv_px,
                 r ? Eigen::Vector2d(-*r)
                   : Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()),
                 !observation.active});
        }
        name_unknowns();
        result.covariance = covariance();
    }

    RigCalibration result;

 private:
    static constexpr int kFewestImages = 3;  // that a point without survey must be seen in

    struct Place {
        Rig rig;
        State state;
        Model model;
        std::unique_ptr<NormalEquations> equations;
        Border border;
        double cost = 0;
    };

    void linearize(Place& place) {
        set_rig(place.model, problem_, place.rig);
        Objective objective(place.model, options_, stage_);
        place.cost = objective.linearize(place.state, *place.equations).total();
        place.border = objective.linearize_rig(place.state, unknowns_, *place.equations);
    }

    // Leaves the trial with its cost; false where there is no step, or it leads nowhere.
    bool try_step(double lambda, double& predicted) {
        Step step;
        Eigen::VectorXd rig_step;
        if (!now_.equations->solve(lambda, now_.border, step, rig_step)) return false;
        predicted = now_.equations->predicted_decrease(step);
        for (Eigen::Index k = 0; k < rig_step.size(); ++k)
            predicted += rig_step(k) *
                         (lambda * now_.border.H(k, k) * rig_step(k) - now_.border.gradient(k));
        try {
            trial_.rig = moved(now_.rig, unknowns_, rig_step);
            Objective(now_.model, options_, stage_)
                .apply(now_.state, step, now_.equations->layout(), trial_.state);
            set_rig(trial_.model, problem_, trial_.rig);
        } catch (const InputError&) {  // no such camera, or images outside the readings
            return false;
        }
        // Linearised, so that the readings are integrated with this state's biases.
        Objective objective(trial_.model, options_, stage_);
        trial_.cost = objective.linearize(trial_.state, *trial_.equations).total();
        return std::isfinite(trial_.cost);
    }

    Eigen::MatrixXd covariance() {
        linearize(now_);
        const char* const kOpen = "calibration: the measurements do not determine ";
        if (!now_.equations->factorize())
            throw InputError(std::string(kOpen) + "the motion; check the board's points and ids");
        const Eigen::MatrixXd H = now_.equations->information(now_.border);
        const Eigen::VectorXd scale = now_.border.H.diagonal().cwiseSqrt().cwiseInverse();
        const Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
        Eigen::Index worst = 0;
        eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&worst);
        constexpr double kSmallest = 1e-13;  // share of the information that survives elimination
        if (!scaled.allFinite() || !(eigen.eigenvalues()(0) > kSmallest))
            throw InputError(kOpen + result.names[worst] +
                             "; move the camera more, about all its axes");
        return scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
    }

    void name_unknowns() {
        if (unknowns_.extrinsics)
            result.names = {"rotation x", "rotation y", "rotation z",
                            "position x", "position y", "position z"};
        if (unknowns_.time_offset) result.names.push_back("time offset");
        if (unknowns_.intrinsics > 0)
            for (const std::string& name : intrinsic_names(*now_.rig.camera, unknowns_.intrinsics))
                result.names.push_back(name);
    }

    const BatchProblem& problem_;
    BatchOptions options_;
    RigUnknowns unknowns_;
    Stage stage_;
    Place now_, trial_;
};

}  // namespace

RigCalibration calibrate_rig(const BatchProblem& problem, const BatchOptions& given,
                             const RigQuestion& question, const Estimate& start) {
    constexpr double kFirstSigma_px = 0.5;
    BatchOptions options = given;
    const bool sigma_known = given.sigma_px > 0;
    if (!sigma_known) options.sigma_px = kFirstSigma_px;
    Calibrator calibrator(problem, options, question, start);
    calibrator.minimize("huber");  // far from the solution, where outliers cannot be told
    calibrator.drop_outliers();
    calibrator.minimize(options.loss);
    if (calibrator.drop_outliers()) calibrator.minimize(options.loss);
    if (!sigma_known) {
        calibrator.set_sigma(std::max(1e-4, calibrator.rms_px()));
        calibrator.drop_outliers();
        calibrator.minimize(options.loss);
    }
    calibrator.publish();
    return std::move(calibrator.result);
}

}  // namespace vio
