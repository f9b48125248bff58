// What `run`, `track` and `render` make of stamps that go back, jump, repeat or end.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/faults/recordings.h"
#include "tests/unit/read_all.h"

namespace vio::test {
namespace {

constexpr TimeNs kSecond = 1'000'000'000;

Message shifted(Message message, TimeNs by) {
    std::visit([&](auto& m) { m.t += by; }, message);
    return message;
}

bool is_image(const Message& message) {
    return std::holds_alternative<ImageMessage>(message) ||
           std::holds_alternative<FeatureFrame>(message);
}

// The first image, or its features, from the n-th on.
std::vector<Message>::iterator image_from(std::vector<Message>& messages, int n) {
    return std::find_if(messages.begin() + n, messages.end(), is_image);
}

class StampFaults : public ::testing::Test {
 protected:
    ProgramResult program(const std::string& arguments) {
        return vio_slam(arguments, folder_.path().string());
    }
    // Writes the recording and runs it.
    ProgramResult run(const Written& recording, const std::string& options = "") {
        write(recording, folder_ / "recording.rawlog");
        return program("run " + (folder_ / "recording.rawlog") + " --overwrite -o " +
                       (folder_ / "out") + " " + options);
    }
    nlohmann::json summary() {
        return nlohmann::json::parse(read_text(folder_ / "out/summary.json"));
    }

    ScratchFolder folder_;
};

// What is stamped before the file's first message is too late for the filter; it counts among the
// recording's images.
TEST_F(StampFaults, APartStampedHoursLaterComesFirst) {
    const Written good = as_written(good_recording());
    Written recording{good.rig, {}};
    for (const Message& message : good.messages)
        recording.messages.push_back(shifted(message, 7200 * kSecond));
    recording.messages.insert(recording.messages.end(), good.messages.begin(), good.messages.end());
    for (const std::string options : {"", "--from 1"}) {
        const ProgramResult result = run(recording, options);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_NE(result.out.find("came more than 0.1 s late"), std::string::npos) << result.out;
        const auto json = summary();
        EXPECT_EQ(json["late_messages"], good.messages.size());
        if (options.empty()) {
            EXPECT_NE(result.out.find("steps back"), std::string::npos) << result.out;
            EXPECT_EQ(json["images_in_recording"], 480);
            EXPECT_EQ(json["images"], 240);
        }
    }
}

// One image whose stamp is wrong, at the beginning of the file, costs nothing but itself.
TEST_F(StampFaults, TheFirstImageIsStampedAhead) {
    Written recording = as_written(good_recording());
    ASSERT_EQ(run(recording).exit_code, 0);
    const auto images = summary()["images"];
    recording.messages.insert(recording.messages.begin(),
                              shifted(*image_from(recording.messages, 0), 3600 * kSecond));
    const ProgramResult result = run(recording);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_GE(summary()["images"], images.get<int>() - 5);
    const ProgramResult part = run(recording, "--from 1");
    expect_one_line(part, {"messages are stamped before the file's first one"});
}

// Within the message window the order of the file does not matter at its beginning either.
TEST_F(StampFaults, AnImageOlderThanTheFirstMessage) {
    Written recording = as_written(good_recording());
    std::erase_if(recording.messages,
                  [](const Message& m) { return std::holds_alternative<ImuReading>(m); });
    ASSERT_EQ(run(recording, "--sensors image").exit_code, 0);
    const std::string path = read_text(folder_ / "out/trajectory.tum");
    std::swap(recording.messages[0], recording.messages[1]);
    const ProgramResult result = run(recording, "--sensors image");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(read_text(folder_ / "out/trajectory.tum"), path);
}

// Only the first 15 s are judged in passing, also where the images end before: a gap after them is
// `check`'s to tell.
TEST_F(StampFaults, ImagesEndInTheFirstSeconds) {
    Written recording = as_written(good_recording());
    const Message last = recording.messages.back();
    for (TimeNs t = 0; t < 40 * kSecond; t += 5'000'000)
        if (t < 30 * kSecond || t > 33 * kSecond)
            recording.messages.emplace_back(
                ImuReading{time_of(last) + t + 5'000'000, {0, 0, 0}, {0, 0, 9.8}});
    const ProgramResult result = run(recording);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.out.find("IMU gaps"), std::string::npos) << result.out;
}

// Tracks and their pictures pass over what is there twice or late, as `run` does.
TEST_F(StampFaults, TrackAndRenderPassOverRepeatedAndLateMessages) {
    Written recording{demo().rig, {demo().messages.begin(), demo().messages.begin() + 300}};
    const auto track = [&](const std::string& name) {
        write(recording, folder_ / (name + ".rawlog"));
        const ProgramResult result = program("track " + (folder_ / (name + ".rawlog")) + " -o " +
                                             (folder_ / (name + "_tracks.rawlog")));
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return result;
    };
    EXPECT_EQ(track("good").out.find("left out"), std::string::npos);
    recording.messages.push_back(*image_from(recording.messages, 40));  // seconds late
    const auto image = image_from(recording.messages, 100);
    recording.messages.insert(image, Message(*image));
    const auto reading = std::find_if(recording.messages.begin() + 200, recording.messages.end(),
                                      [](const Message& m) { return !is_image(m); });
    recording.messages.insert(reading, Message(*reading));
    const ProgramResult spoilt = track("spoilt");
    EXPECT_NE(spoilt.out.find("2 messages that are there twice"), std::string::npos) << spoilt.out;
    EXPECT_NE(spoilt.out.find("1 messages that came more than 0.1 s late"), std::string::npos)
        << spoilt.out;
    const auto good_frames = read_all<FeatureFrame>(folder_ / "good_tracks.rawlog");
    const auto frames = read_all<FeatureFrame>(folder_ / "spoilt_tracks.rawlog");
    ASSERT_EQ(frames.size(), good_frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_EQ(frames[i].t, good_frames[i].t);
        EXPECT_EQ(frames[i].features.size(), good_frames[i].features.size());
    }
    const ProgramResult picture = program("render " + (folder_ / "spoilt.rawlog") + " -o " +
                                          (folder_ / "tracks.png") + " --images 2");
    EXPECT_EQ(picture.exit_code, 0) << picture.err;
}

// The figure of speed is about the time that images cover.
TEST_F(StampFaults, HoursWithoutImages) {
    Written recording = as_written(good_recording());
    const std::size_t half = recording.messages.size() / 2;
    for (std::size_t i = half; i < recording.messages.size(); ++i)
        recording.messages[i] = shifted(recording.messages[i], 7200 * kSecond);
    const ProgramResult result = run(recording);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const auto json = summary();
    const double work = json["tracking_s"].get<double>() + json["estimation_s"].get<double>();
    EXPECT_NEAR(json["real_time_ratio"].get<double>() * work, 239 / 20., 0.2);
}

// An IMU that is not found in the first 10 s is one that the file has, and the program says so.
TEST_F(StampFaults, ReadingsBeginAfterTenSeconds) {
    Written recording = as_written(good_recording());
    const TimeNs begin = time_of(recording.messages[0]);
    std::erase_if(recording.messages, [&](const Message& m) {
        return !is_image(m) && time_of(m) < begin + 11 * kSecond;
    });
    expect_one_line(run(recording), {"no IMU readings in the first 10 s"});
    const ProgramResult alone = run(recording, "--sensors image");
    EXPECT_EQ(alone.exit_code, 0) << alone.err;
    EXPECT_NE(alone.out.find("also in the file: IMU 'imu0'; not used"), std::string::npos)
        << alone.out;
}

// What is passed over for its label is named.
TEST_F(StampFaults, ASecondCameraAndImuAreNamed) {
    const Written good = as_written(good_recording());
    write(good, folder_ / "good.rawlog");
    RawlogWriterOptions labels;
    labels.camera_label = "right";
    labels.imu_label = "imu1";
    {
        RawlogWriter writer(folder_ / "others.rawlog", good.rig, labels);
        for (std::size_t i = 0; i < 100; ++i) writer.write(good.messages[i]);
        writer.finish();
    }
    std::ofstream(folder_ / "both.rawlog", std::ios::binary)
        << read_text(folder_ / "good.rawlog") << read_text(folder_ / "others.rawlog");
    const ProgramResult result =
        program("run " + (folder_ / "both.rawlog") + " -o " + (folder_ / "both"));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("also in the file: camera 'right', IMU 'imu1'; not used"),
              std::string::npos)
        << result.out;
}

}  // namespace
}  // namespace vio::test
