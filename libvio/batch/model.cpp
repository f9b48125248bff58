#include "libvio/batch/model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "libvio/base/median.h"

namespace vio::batch {
namespace {

std::string at_time(TimeNs t) {
    return "(t = " + std::to_string(t) + " ns)";
}

// How gyro and accelerometer change from reading to reading: spacing and mean squared change per
// second, as those of a random walk.
struct ReadingChange {
    double spacing = 0;          // median [s]
    double gyro = 0, accel = 0;  // of one axis [(rad/s)^2/s], [(m/s^2)^2/s]
};

ReadingChange reading_change(const std::vector<ImuReading>& readings) {
    ReadingChange change;
    std::vector<double> spacings;
    for (size_t k = 1; k < readings.size(); ++k) {
        const ImuReading &a = readings[k - 1], &b = readings[k];
        spacings.push_back(to_seconds(b.t - a.t));
        change.gyro += (b.gyro - a.gyro).squaredNorm() / 3;
        change.accel += (b.accel - a.accel).squaredNorm() / 3;
    }
    if (spacings.empty()) return change;
    const double span = to_seconds(readings.back().t - readings.front().t);
    change.gyro /= span;
    change.accel /= span;
    change.spacing = median(std::move(spacings));
    return change;
}

// Noise of the readings in an interval with a gap: what is interpolated across it errs like a
// random walk that is held at both ends, whose mean over the gap has variance q gap / 12.
ImuNoise with_gap(ImuNoise noise, const ReadingChange& change, double gap) {
    constexpr double kGap = 2.5;  // in spacings
    if (gap <= kGap * change.spacing) return noise;
    const auto inflated = [&](double density, double q) {
        return std::sqrt(density * density + q * gap * gap / 12);
    };
    noise.gyro_noise_density = inflated(noise.gyro_noise_density, change.gyro);
    noise.accel_noise_density = inflated(noise.accel_noise_density, change.accel);
    return noise;
}

void index_inertial(Model& model, const BatchProblem& problem, double time_offset) {
    const TimeNs offset = from_seconds(time_offset);
    model.segments.clear();
    model.interval_noise.clear();
    model.gyro_at_image.clear();
    model.accel_at_image.clear();
    const ReadingChange change = reading_change(problem.imu.readings());
    for (int i = 0; i < model.frames(); ++i) {
        const TimeNs t = model.times[i] + offset;
        const auto reading = problem.imu.interpolate(t);
        if (!reading)
            throw InputError("image " + at_time(model.times[i]) +
                             ": no IMU readings at its time; cut the images to the IMU's span");
        model.gyro_at_image.push_back(reading->gyro);
        model.accel_at_image.push_back(reading->accel);
        if (i == 0) continue;
        const TimeNs before = model.times[i - 1] + offset;
        model.segments.push_back(*problem.imu.segments(before, t));
        model.interval_noise.push_back(
            with_gap(model.noise, change, problem.imu.largest_gap(before, t)));
    }
}

}  // namespace

bool Model::surveyed() const {
    return std::any_of(points.begin(), points.end(), [](const Point& p) { return p.fiducial; });
}

BatchProblem without_images_at_ends(const BatchProblem& problem, double time_offset_sigma) {
    constexpr double kSigmas = 3;
    const auto& readings = problem.imu.readings();
    const TimeNs margin = from_seconds(kSigmas * time_offset_sigma);
    const TimeNs offset = from_seconds(problem.rig.time_offset);
    BatchProblem rest = problem;
    // What lies outside as it is stands for a mistake, which is told where the readings are cut.
    std::erase_if(rest.frames, [&](const FeatureFrame& frame) {
        const TimeNs t = frame.t + offset;
        return !readings.empty() && t >= readings.front().t && t <= readings.back().t &&
               (t < readings.front().t + margin || t > readings.back().t - margin);
    });
    return rest;
}

BatchProblem without_unseeing_images(const BatchProblem& problem) {
    constexpr int kFewestPoints = 4, kFewestImages = 3;
    BatchProblem rest = problem;
    for (size_t before = 0; before != rest.frames.size();) {
        before = rest.frames.size();
        std::map<FeatureId, int> images;
        for (const FeatureFrame& frame : rest.frames)
            for (const FeatureObservation& f : frame.features) ++images[f.feature_id];
        std::erase_if(rest.frames, [&](const FeatureFrame& frame) {
            return std::count_if(frame.features.begin(), frame.features.end(),
                                 [&](const FeatureObservation& f) {
                                     return images[f.feature_id] >= kFewestImages;
                                 }) < kFewestPoints;
        });
    }
    return rest;
}

Model make_model(const BatchProblem& problem, const BatchOptions& options, int frame_count,
                 int min_observations) {
    if (!problem.rig.camera) throw InputError("batch estimator: no camera calibration; give one");
    if (frame_count < 2)
        throw InputError("batch estimator: " + std::to_string(frame_count) +
                         " image(s) with features; at least 2 are needed");
    Model model;
    struct Seen {
        int frame_idx;
        const FeatureObservation* observation;
    };
    std::map<FeatureId, std::vector<Seen>> seen;
    for (int i = 0; i < frame_count; ++i) {
        const FeatureFrame& frame = problem.frames[i];
        if (i > 0 && frame.t <= problem.frames[i - 1].t)
            throw InputError("image " + at_time(frame.t) + ": time does not increase");
        model.times.push_back(frame.t);
        for (const FeatureObservation& f : frame.features) seen[f.feature_id].push_back({i, &f});
    }
    set_rig(model, problem, problem.rig);

    for (const auto& [id, sightings] : seen) {
        const auto fiducial = problem.fiducials.find(id);
        const bool surveyed = fiducial != problem.fiducials.end();
        if (!surveyed && static_cast<int>(sightings.size()) < min_observations) continue;
        Point point{id, static_cast<int>(model.observations.size()),
                    static_cast<int>(sightings.size()), surveyed ? &fiducial->second : nullptr};
        for (const Seen& s : sightings) {
            const Eigen::Matrix2d covariance =
                options.sigma_px * options.sigma_px * s.observation->covariance_shape;
            const Eigen::Matrix2d L = covariance.llt().matrixL();
            model.observations.push_back({s.frame_idx, static_cast<int>(model.points.size()),
                                          s.observation->uv_px, L.inverse(), true});
        }
        model.points.push_back(point);
    }
    if (!problem.fiducials.empty() && !model.surveyed())
        throw InputError(
            "batch estimator: none of the fiducials is seen in the images; compare their ids with "
            "the feature ids");
    if (model.points.empty())
        throw InputError("batch estimator: no feature is seen in " +
                         std::to_string(min_observations) +
                         " images; check tracking or the feature ids");
    return model;
}

void set_rig(Model& model, const BatchProblem& problem, const Rig& rig) {
    model.inertial = !problem.imu.empty();
    set_camera(model, rig);
    model.noise = rig.imu_noise;
    if (model.inertial) index_inertial(model, problem, rig.time_offset);
}

void set_camera(Model& model, const Rig& rig) {
    model.camera = rig.camera;
    // Image-only estimates the body itself: there is no IMU to stand for it.
    model.T_I_B = model.inertial ? rig.T_B_I.inverse() : Pose{};
    model.T_I_C = model.T_I_B * rig.T_B_C;
    model.T_C_I = model.T_I_C.inverse();
}

std::vector<int> Layout::block_dims() const {
    std::vector<int> dims;
    for (int i = 0; i < frames; ++i) {
        dims.push_back(6);
        if (inertial) dims.push_back(motion_dim());
    }
    dims.insert(dims.end(), border_points, 3);
    if (inertial) dims.push_back(global_dim());
    return dims;
}

int Layout::index(int frame, int component) const {
    if (component < 6) return frame * frame_dim() + component;
    if (!inertial) return -1;
    if (component < 9 || bias_per_frame) return frame * frame_dim() + component;
    return global_index() + 3 + (component - 9);
}

int Layout::gravity_index() const {
    return inertial ? global_index() : -1;
}

int thread_count(const BatchOptions& options) {
    const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    return options.threads == 0 ? processors : std::min(options.threads, processors);
}

Layout make_layout(const Model& model, const BatchOptions& options) {
    Layout layout;
    layout.inertial = model.inertial;
    layout.bias_per_frame = options.bias == "random_walk";
    layout.frames = model.frames();
    // Eliminating a point couples all pairs of images that see it. A column in the border costs
    // about one pass over all frames, three columns a point: long tracks belong there.
    constexpr int kLongTrack = 80;
    for (const Point& point : model.points)
        layout.border_of_point.push_back(
            point.observation_count > kLongTrack ? layout.border_points++ : -1);
    return layout;
}

}  // namespace vio::batch
