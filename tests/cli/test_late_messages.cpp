// Messages that a recording holds out of order.
#include <gtest/gtest.h>

#include <algorithm>

#include "libvio/io/rawlog_writer.h"
#include "libvio/simulation/scenario.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

// Features arrive late by up to `delay`, alternately by half of it.
void write_delayed(const Simulation& simulation, TimeNs delay, const std::string& file) {
    std::vector<std::pair<TimeNs, StreamEntry>> arrivals;
    for (const StreamEntry& entry : simulation.stream()) {
        const bool image = entry.kind == StreamEntry::Kind::kImage;
        arrivals.push_back({entry.t + (image ? delay / (1 + entry.index % 2) : 0), entry});
    }
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    RawlogWriter writer(file, simulation.rig());
    for (const auto& [t, entry] : arrivals) {
        const auto index = static_cast<std::size_t>(entry.index);
        if (entry.kind == StreamEntry::Kind::kImu) writer.write(simulation.imu()[index]);
        if (entry.kind == StreamEntry::Kind::kImage)
            writer.write(simulation.tracks().frames[index]);
    }
    writer.finish();
}

// Within the window the order of arrival does not change a byte; beyond it messages are counted and
// dropped, and the user is told.
TEST(LateMessages, DoNotMatterWithinTheWindowAndAreCountedBeyond) {
    const ScratchFolder scratch;
    const Simulation simulation(
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini",
                                   {"camera.count=100", "tracks.most=40", "tracks.fewest=35"}));
    const auto run = [&](const std::string& name, TimeNs delay) {
        write_delayed(simulation, delay, scratch / (name + ".rawlog"));
        return vio_slam("run " + (scratch / (name + ".rawlog")) + " -o " + (scratch / name),
                        scratch.path().string());
    };
    const ProgramResult ordered = run("ordered", 0);
    ASSERT_EQ(ordered.exit_code, 0) << ordered.err;
    EXPECT_EQ(ordered.out.find("left out"), std::string::npos);
    const std::string path = read_text(scratch / "ordered/trajectory.tum");
    ASSERT_GT(std::count(path.begin(), path.end(), '\n'), 90);

    const ProgramResult late = run("late", 80'000'000);
    ASSERT_EQ(late.exit_code, 0) << late.err;
    EXPECT_EQ(late.out.find("left out"), std::string::npos) << late.out;
    EXPECT_EQ(read_text(scratch / "late/trajectory.tum"), path);

    const ProgramResult too_late = run("too_late", 160'000'000);
    ASSERT_EQ(too_late.exit_code, 0) << too_late.err;
    EXPECT_NE(too_late.out.find("left out"), std::string::npos) << too_late.out;
    EXPECT_NE(too_late.out.find("more than 0.1 s late"), std::string::npos) << too_late.out;
}

}  // namespace
}  // namespace vio::test
