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

/// Twelve seconds of the stress scenarios' common base: a hand-held camera looks around a room;
/// features with 0.3 px of noise, a consumer IMU.
inline const Simulation& good_recording() {
    static const Simulation simulation(
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini",
                                   {"camera.count=240", "tracks.noise=0.3"}));
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

/// Changes every reading.
inline Written with_readings(Written recording, const std::function<void(ImuReading&)>& change) {
    for (Message& message : recording.messages)
        if (auto* reading = std::get_if<ImuReading>(&message)) change(*reading);
    return recording;
}

}  // namespace vio::test
