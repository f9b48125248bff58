#include "app/estimator.h"

#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "libvio/batch/rig_refinement.h"
#include "libvio/calibration/board_file.h"
#include "libvio/io/results.h"

namespace vio::app {
namespace {

// Collects everything; the estimate is made in finish().
class Batch final : public Estimator {
 public:
    Batch(const RunRequest& request, const Rig& rig) : options_(request.options.batch) {
        problem_.rig = rig;
        if (!request.fiducials_file.empty())
            problem_.fiducials = read_fiducials(request.fiducials_file);
        if (!request.start_folder.empty()) start_ = read_results(request.start_folder);
        if ((options_.start != "auto" && options_.start != "iekf") || start_) return;
        starter_.emplace(rig, request.options.iekf, options_, request.use_imu);
    }

    void add(const ImuReading& reading) override {
        problem_.imu.push_back(reading);
        if (starter_) starter_->add(reading);
    }
    void add(const FeatureFrame& frame) override {
        problem_.frames.push_back(frame);
        if (starter_) starter_->add(frame);
    }
    void finish() override {
        if (starter_) {
            starter_->finish();
            start_ = starter_->take();
        }
        if (start_ && start_->states.empty())
            result_.report.reason = "the recursive estimator gave no start";
        else
            result_ = estimate_batch(problem_, options_, start_);
        if (starter_ && options_.start == "auto" && !result_.report.converged) start_anew();
    }

    Estimate take() override { return std::exchange(result_.estimate, {}); }
    std::vector<LandmarkEstimate> landmarks() const override { return {}; }
    std::string report() const override {
        const BatchReport& r = result_.report;
        std::ostringstream text;
        text << r.reason << ", " << r.iterations << " iterations, cost " << r.final_cost
             << " (image " << r.image_cost << ", inertial " << r.inertial_cost << ", prior "
             << r.prior_cost << "), " << r.outliers << " of " << r.observations + r.outliers
             << " observations dropped";
        if (r.scale_sigma > 0) text << ", scale known to " << 100 * r.scale_sigma << " %";
        return text.str();
    }
    std::vector<StatusEntry> events() const override {
        return starter_ ? starter_->status() : std::vector<StatusEntry>{};
    }
    bool converged() const override { return result_.report.converged; }
    int iterations() const override { return result_.report.iterations; }
    const RefinedRig* refined_rig() const override { return result_.rig ? &*result_.rig : nullptr; }
    std::vector<FeatureId> take_rejected() override { return {}; }
    std::vector<PredictedFeature> predict(TimeNs) const override { return {}; }

 private:
    // Grows the estimate from a prefix instead; keeps what there is if that is no better.
    void start_anew() {
        BatchResult grown = estimate_batch(problem_, options_);
        if (!grown.report.converged && !result_.estimate.states.empty()) return;
        grown.report.reason +=
            " (from a staged start; from the recursive estimate: " + result_.report.reason + ")";
        result_ = std::move(grown);
    }

    BatchProblem problem_;
    BatchOptions options_;
    std::optional<Iekf> starter_;    // if the start is to come from it
    std::optional<Estimate> start_;  // from it, or given
    BatchResult result_;
};

class Recursive final : public Estimator {
 public:
    Recursive(const Rig& rig, const IekfOptions& options, const BatchOptions& prefix, bool use_imu)
        : filter_(rig, options, prefix, use_imu) {}

    void add(const ImuReading& reading) override { filter_.add(reading); }
    void add(const FeatureFrame& frame) override { filter_.add(frame); }
    void finish() override {
        filter_.finish();
        rig_ = filter_.refined_rig();
    }

    Estimate take() override {
        Estimate piece = filter_.take();
        started_ = started_ || !piece.states.empty();
        return piece;
    }
    std::vector<LandmarkEstimate> landmarks() const override {
        return filter_.estimate().landmarks;
    }
    std::string report() const override { return ""; }
    std::vector<StatusEntry> events() const override { return filter_.status(); }
    bool converged() const override { return started_; }
    int iterations() const override { return 0; }
    const RefinedRig* refined_rig() const override { return rig_ ? &*rig_ : nullptr; }
    std::vector<FeatureId> take_rejected() override { return filter_.take_rejected(); }
    std::vector<PredictedFeature> predict(TimeNs t) const override { return filter_.predict(t); }

 private:
    Iekf filter_;
    bool started_ = false;
    std::optional<RefinedRig> rig_;
};

}  // namespace

std::unique_ptr<Estimator> make_estimator(const RunRequest& request, const Rig& rig) {
    const PipelineOptions& options = request.options;
    if (request.estimator == "batch") return std::make_unique<Batch>(request, rig);
    if (batch::rig_unknowns(rig, options.batch).count() > 0)
        throw InputError(
            "options: batch.intrinsics_sigma, extrinsics_*_sigma and time_offset_sigma act with "
            "--estimator batch; the recursive estimator has iekf.camera_rotation_sigma, "
            "camera_position_sigma and time_offset_sigma");
    return std::make_unique<Recursive>(rig, options.iekf, options.batch, request.use_imu);
}

}  // namespace vio::app
