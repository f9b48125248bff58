// Damaged rawlogs, full disks, folders that cannot be written, runs that are killed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "libvio/io/recording.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"
#include "tests/faults/recordings.h"

namespace vio::test {
namespace {

namespace fs = std::filesystem;

class FileFaults : public ::testing::Test {
 protected:
    FileFaults() {
        write(as_written(good_recording()), folder_ / "good.rawlog");
        bytes_ = read_text(folder_ / "good.rawlog");
    }

    std::string file_of(const std::string& bytes) {
        const std::string file = folder_ / "recording.rawlog";
        std::ofstream(file, std::ios::binary) << bytes;
        return file;
    }

    ProgramResult program(const std::string& arguments) {
        return vio_slam(arguments, folder_.path().string());
    }

    // Runs a line of the shell in which $VIO stands for the program.
    ProgramResult shell(const std::string& line) {
        std::ofstream(folder_ / "line.sh")
            << "VIO='" << VIO_SLAM_PROGRAM << "'\ncd '" << folder_.path().string() << "'\n"
            << line << "\n";
        const int status =
            std::system(("bash '" + (folder_ / "line.sh") + "' >'" + (folder_ / "stdout.txt") +
                         "' 2>'" + (folder_ / "stderr.txt") + "'")
                            .c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(folder_ / "stdout.txt"),
                read_text(folder_ / "stderr.txt")};
    }

    static void expect_one_line(const ProgramResult& result, const std::string& words) {
        EXPECT_EQ(result.exit_code, 1) << result.out << result.err;
        test::expect_one_line(result, {words});
    }

    ScratchFolder folder_;
    std::string bytes_;  // of a good rawlog
};

int messages_up_to_damage(const std::string& file, std::string& damage) {
    int count = 0;
    damage = error_of([&] {
        Recording recording(file);
        while (recording.next()) ++count;
    });
    return count;
}

// Cut at every hundredth of its length: what comes before is read, the rest is told.
TEST_F(FileFaults, CutAnywhere) {
    int before = 0;
    for (int percent = 1; percent < 100; ++percent) {
        const std::string file = file_of(bytes_.substr(0, bytes_.size() * percent / 100));
        std::string damage;
        const int messages = messages_up_to_damage(file, damage);
        EXPECT_NE(damage.find(file), std::string::npos) << percent << ": " << damage;
        EXPECT_NE(damage.find("the file is cut off"), std::string::npos)
            << percent << ": " << damage;
        EXPECT_GE(messages, before) << percent;
        before = messages;
    }
    EXPECT_GT(before, 2000);
}

// A run gives the results of what can be read and fails with the line; too little to start from is
// a failure without results.
TEST_F(FileFaults, RunOfACutFileKeepsItsBeginning) {
    for (const int percent : {2, 60}) {
        const std::string file = file_of(bytes_.substr(0, bytes_.size() * percent / 100));
        const std::string out = folder_ / ("out" + std::to_string(percent));
        expect_one_line(program("run " + file + " -o " + out), "the file is cut off");
        EXPECT_EQ(fs::exists(out + "/summary.json"), percent == 60);
        EXPECT_EQ(fs::exists(out), percent == 60) << "a folder for nothing";
        if (percent == 2)
            expect_one_line(program("run " + file + " -o " + out), "no pose could be estimated");
        if (percent == 60) {
            EXPECT_GT(read_results(out).states.size(), 100u);
        }
    }
    expect_one_line(program("check " + (folder_ / "recording.rawlog")),
                    "an estimate from it is not to be relied on");
}

// A byte that is not what was written: the checksum or the layout shows it, or what was read is
// still a recording. Never anything else.
TEST_F(FileFaults, BytesFlipped) {
    std::uint64_t random = 1;
    int told = 0;
    constexpr int kFlips = 25;
    for (int i = 0; i < kFlips; ++i) {
        std::string spoilt = bytes_;
        random = random * 6364136223846793005ULL + 1442695040888963407ULL;
        spoilt[(random >> 20) % spoilt.size()] ^= static_cast<char>(1 << ((random >> 12) % 8));
        std::string damage;
        messages_up_to_damage(file_of(spoilt), damage);
        told += !damage.empty();
        EXPECT_EQ(damage.find('\n'), std::string::npos) << damage;
    }
    EXPECT_GT(told, kFlips * 8 / 10);
}

// MRPT itself would say so in words of its own, and go on without an object.
TEST_F(FileFaults, ObjectOfAnAbstractClass) {
    for (const std::string name : {"mrpt::obs::CObservation", "CObservation"}) {
        const char length = static_cast<char>(name.size() | 0x80), version = 0, end = -120;
        const std::string file = file_of(length + name + version + end);
        expect_one_line(program("check " + file),
                        "class mrpt::obs::CObservation, which is abstract");
    }
}

// One reading that is no number ends nothing: it is left out, counted, and named.
TEST_F(FileFaults, ReadingNotFinite) {
    Written recording = as_written(good_recording());
    const auto half =
        recording.messages.begin() + static_cast<std::ptrdiff_t>(recording.messages.size() / 2);
    const auto reading = std::find_if(half, recording.messages.end(), [](const Message& message) {
        return std::holds_alternative<ImuReading>(message);
    });
    std::get<ImuReading>(*reading).gyro.x() = std::numeric_limits<double>::quiet_NaN();
    const std::string file = folder_ / "recording.rawlog", out = folder_ / "out";
    write(recording, file);
    const std::string object = std::to_string(reading - recording.messages.begin() + 1);
    const std::string told =
        "left out: 1 IMU readings: " + file + " (object " + object + "): the IMU reading at ";

    const ProgramResult run = program("run " + file + " -o " + out);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_NE(run.out.find("warning     " + told), std::string::npos) << run.out;
    EXPECT_NE(read_text(out + "/summary.json").find(told), std::string::npos);
    // Of an image at 20 Hz, each of the 12 s.
    EXPECT_GT(read_results(out).states.size(), 200u);

    const ProgramResult check = program("check " + file);
    EXPECT_NE(check.out.find("read to its end"), std::string::npos) << check.out;
    EXPECT_NE(check.out.find("1 IMU readings: " + file), std::string::npos) << check.out;
}

// Images beside the rawlog: without one of them, the others; without their folder, one line.
TEST_F(FileFaults, ImageFileMissing) {
    const std::string file = folder_ / "recording.rawlog";
    {
        Recording demo(VIO_SOURCE_DIR "/datasets/demo.rawlog");
        RawlogWriterOptions external;
        external.external_images = true;
        RawlogWriter writer(file, demo.rig(), external);
        for (int images = 0; images < 20;) {
            const auto message = demo.next();
            images += std::holds_alternative<ImageMessage>(*message);
            writer.write(*message);
        }
        writer.finish();
    }
    const fs::path folder = folder_ / "recording_Images";
    std::vector<fs::path> images(fs::directory_iterator(folder), {});
    ASSERT_EQ(images.size(), 20u);
    fs::remove(images[3]);
    std::ofstream(images[5]) << "no image";
    const ProgramResult one = program("check " + file);
    EXPECT_NE(one.out.find("read to its end"), std::string::npos) << one.out;
    EXPECT_NE(one.out.find("2 images; the first: " + file), std::string::npos) << one.out;
    fs::remove_all(folder);
    expect_one_line(program("run " + file + " -o " + (folder_ / "out")),
                    "keep that folder beside the rawlog");
}

TEST_F(FileFaults, DiskFull) {
    file_of(bytes_);
    // Files of at most 20 kB stand for a disk that fills.
    expect_one_line(shell("ulimit -f 20; \"$VIO\" run recording.rawlog -o out >/dev/null"),
                    "cannot be written; check folder and space");
    expect_one_line(shell("ulimit -f 20; \"$VIO\" simulate '" VIO_SOURCE_DIR
                          "/datasets/stress/base.ini' -o made.rawlog >/dev/null"),
                    "cannot be written; check folder and space");
    EXPECT_FALSE(fs::exists(folder_ / "made.rawlog"));
    expect_one_line(shell("\"$VIO\" run --print-options >/dev/full"), "is the disk full?");
}

TEST_F(FileFaults, FolderNotWritable) {
    const std::string file = file_of(bytes_);
    std::ofstream(folder_ / "taken") << "a file\n";
    expect_one_line(program("run " + file + " -o " + (folder_ / "taken")), folder_ / "taken");
    expect_one_line(program("run " + file + " -o /proc/vio-slam"), "/proc/vio-slam");
}

TEST_F(FileFaults, OlderResultsAreKeptUnlessAsked) {
    const std::string file = file_of(bytes_), out = folder_ / "out";
    const std::string command = "run " + file + " --to 4 -o " + out;
    ASSERT_EQ(program(command).exit_code, 0);
    const std::string path = read_text(out + "/trajectory.tum");
    std::ofstream(out + "/notes.txt") << "mine\n";
    expect_one_line(program("run " + file + " --from 2 -o " + out), "holds results already");
    EXPECT_EQ(read_text(out + "/trajectory.tum"), path);
    ASSERT_EQ(program("run " + file + " --from 2 --overwrite -o " + out).exit_code, 0);
    EXPECT_NE(read_text(out + "/trajectory.tum"), path);
    EXPECT_EQ(read_text(out + "/notes.txt"), "mine\n");
}

// Killed in mid-run: the path so far is a valid file, and is not taken for a finished result.
TEST_F(FileFaults, KilledInMidRun) {
    file_of(bytes_);
    const ProgramResult result = shell(
        "\"$VIO\" run recording.rawlog -o out & run=$!\n"
        "while kill -0 $run 2>/dev/null; do\n"
        "  [ -f out/trajectory.tum ] && [ $(wc -l <out/trajectory.tum) -gt 30 ] && break\n"
        "  sleep 0.002\n"
        "done\n"
        "kill -9 $run; wait $run; echo $?");
    EXPECT_NE(result.out.find("137"), std::string::npos) << "finished before it was killed";
    EXPECT_FALSE(fs::exists(folder_ / "out/summary.json"));
    EXPECT_GT(read_trajectory(folder_ / "out/trajectory.tum").size(), 20u);
    EXPECT_GT(read_results(folder_ / "out").states.size(), 20u);
    expect_one_line(program("run " + (folder_ / "recording.rawlog") + " -o " + (folder_ / "out")),
                    "holds results already");
}

}  // namespace
}  // namespace vio::test
