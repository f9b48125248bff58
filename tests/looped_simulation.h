// A scenario driven to and fro without end, lap by lap, in bounded memory.
#pragma once

#include <string>
#include <vector>

#include "libvio/simulation/scenario.h"

namespace vio::test {

/// Every second lap is the first one driven backwards. The scenario's path rests at its ends.
class LoopedSimulation {
 public:
    explicit LoopedSimulation(const ScenarioOptions& options)
        : simulation_(without_tracks(options)),
          begin_(simulation_.seconds(simulation_.image_times().front())),
          length_(simulation_.seconds(simulation_.image_times().back()) - begin_),
          period_(length_ + 1 / options.image_rate),
          options_(options) {
        if (!options.motion.rests_at_ends() || !options.recorded_file.empty())
            throw InputError(options.name + ": does not rest at its ends; take another scenario");
        Random random(static_cast<std::uint64_t>(options.seed), "imu errors");
        errors_ = options.imu;
        errors_.initial_bias.gyro = options.gyro_bias_sigma * random.normal3();
        errors_.initial_bias.accel = options.accel_bias_sigma * random.normal3();
    }

    const Rig& rig() const { return simulation_.rig(); }
    double period() const { return period_; }  ///< of a lap [s]

    struct Lap {
        std::vector<ImuReading> readings;
        std::vector<FeatureFrame> frames;
        std::vector<StateEstimate> truth;  ///< at each frame: time, pose and velocity
    };

    Lap next() {
        const Drive drive(simulation_.trajectory(), begin_, length_, lap_ % 2 == 1);
        const auto seed = mixed(static_cast<std::uint64_t>(options_.seed) + 1000003u * lap_);
        const TimeNs start = simulation_.stamp(begin_) + from_seconds(lap_ * period_);
        Lap lap;
        std::vector<double> image_times;
        std::vector<TimeNs> stamps;
        std::vector<Pose> cameras;
        for (const TimeNs t : simulation_.image_times()) {
            image_times.push_back(simulation_.seconds(t) - begin_);
            stamps.push_back(start + from_seconds(image_times.back()));
            const Motion motion = drive.at(image_times.back());
            cameras.push_back(motion.T_W_B * rig().T_B_C);
            StateEstimate truth;
            truth.t = stamps.back();
            truth.T_W_B = motion.T_W_B;
            truth.v_W = motion.v_W;
            lap.truth.push_back(truth);
        }
        Random times_random(seed, "imu times"), imu_random(seed, "imu"),
            tracks_random(seed, "tracks");
        const auto times =
            imu_times(0, period_, options_.imu_rate, options_.imu_jitter_s, times_random);
        const SimulatedImu imu =
            with_errors(ideal_imu(drive, rig().T_B_I, simulation_.g_W(), times, image_times),
                        errors_, imu_random);
        errors_.initial_bias = imu.biases.back();
        const TimeNs shift = start + from_seconds(rig().time_offset);
        for (ImuReading reading : imu.readings) {
            if (lap_ > 0 && reading.t < 0) continue;
            if (reading.t >= from_seconds(period_)) continue;
            reading.t += shift;
            lap.readings.push_back(reading);
        }
        lap.frames = simulate_tracks(simulation_.scene(), *rig().camera, stamps, cameras,
                                     options_.track_model, tracks_random)
                         .frames;
        constexpr FeatureId kIdsOfALap = 100'000'000;
        for (FeatureFrame& frame : lap.frames)
            for (FeatureObservation& feature : frame.features)
                feature.feature_id += kIdsOfALap * lap_;
        ++lap_;
        return lap;
    }

 private:
    // The path from its first to its last image, or backwards; at rest before and after.
    class Drive final : public Trajectory {
     public:
        Drive(const Trajectory& path, double begin, double length, bool backwards)
            : path_(path), begin_(begin), length_(length), backwards_(backwards) {}
        Motion at(double t) const override {
            if (!backwards_) return path_.at(begin_ + t);
            Motion motion = path_.at(begin_ + length_ - t);
            motion.v_W *= -1;
            motion.omega_B *= -1;
            return motion;
        }
        double begin() const override { return 0; }
        double end() const override { return length_; }

     private:
        const Trajectory& path_;
        double begin_, length_;
        bool backwards_;
    };

    static ScenarioOptions without_tracks(ScenarioOptions options) {
        options.tracks = false;
        options.odometry.make = options.gps.make = false;
        return options;
    }

    Simulation simulation_;
    double begin_, length_, period_;
    ScenarioOptions options_;
    ImuErrors errors_;
    FeatureId lap_ = 0;
};

}  // namespace vio::test
