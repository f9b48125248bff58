// Short recordings to be spoilt.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libvio/geometry/so3.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/simulation/scenario.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {

/// Twelve seconds of the stress scenarios' common base, some of whose values are replaced: a
/// hand-held camera looks around a room; features with 0.3 px of noise, a consumer IMU.
inline Simulation room_recording(std::vector<std::string> values = {}) {
    values.insert(values.begin(), {"camera.count=240", "tracks.noise=0.3"});
    return Simulation(ScenarioOptions::from_file(
        std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini", values));
}

inline const Simulation& good_recording() {
    static const Simulation simulation = room_recording();
    return simulation;
}

/// The same through a fisheye lens of 190 degrees, and by way of an equiangular mirror above which
/// nothing is seen and which is tilted by 0.36 degrees.
inline const Simulation& fisheye_recording() {
    static const Simulation simulation =
        room_recording({"camera.model=fisheye", "camera.intrinsics=200 200 319.5 239.5",
                        "camera.distortion=0.02 -0.005 0.001 0", "camera.max_angle=95"});
    return simulation;
}
inline const Simulation& mirror_recording() {
    static const Simulation simulation = room_recording(
        {"camera.model=equiangular_mirror", "camera.intrinsics=2162 2162 319.5 239.5",
         "camera.distortion=0 0 0 0", "camera.gain=15", "camera.apex_distance=0.15",
         "camera.rim_radius=0.0172", "camera.blind_radius=0.004",
         "camera.mirror_pose=0.001 0 0 0 0.3 -0.2", "camera.pose=0.05 0 0.02 0 0 0"});
    return simulation;
}

/// A recording as it is written: messages in order of the file, and the calibration.
struct Written {
    Rig rig;
    std::vector<Message> messages;
};

inline Written as_written(const Simulation& simulation) {
    Written out{simulation.rig(), {}};
    for (const StreamEntry& entry : simulation.stream()) {
        const auto i = static_cast<std::size_t>(entry.index);
        if (entry.kind == StreamEntry::Kind::kImu) out.messages.emplace_back(simulation.imu()[i]);
        if (entry.kind == StreamEntry::Kind::kImage)
            out.messages.emplace_back(simulation.tracks().frames[i]);
    }
    return out;
}

inline void write(const Written& recording, const std::string& file) {
    RawlogWriter writer(file, recording.rig);
    for (const Message& message : recording.messages) writer.write(message);
    writer.finish();
}

/// Images of 640 x 240 px.
inline const Written& demo() {
    static const Written recording = [] {
        Recording file(VIO_SOURCE_DIR "/datasets/demo.rawlog");
        Written read{file.rig(), {}};
        while (auto message = file.next()) read.messages.push_back(*message);
        return read;
    }();
    return recording;
}

/// Changes every reading.
inline Written with_readings(Written recording, const std::function<void(ImuReading&)>& change) {
    for (Message& message : recording.messages)
        if (auto* reading = std::get_if<ImuReading>(&message)) change(*reading);
    return recording;
}

}  // namespace vio::test
