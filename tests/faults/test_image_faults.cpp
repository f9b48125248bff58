// Images that are not as the others, or not of 8 bits.
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/faults/recordings.h"
#include "tests/unit/read_all.h"

namespace vio::test {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMessages = 200;  // of the demo: 30 images

class ImageFaults : public ::testing::Test {
 protected:
    ImageFaults()
        : beginning_{demo().rig, {demo().messages.begin(), demo().messages.begin() + kMessages}} {}

    ProgramResult program(const std::string& arguments) {
        return vio_slam(arguments, folder_.path().string());
    }

    // The beginning of the demo with its images in files, whose values have so many bits of 16.
    void write_deep(const std::string& file, int bits) {
        RawlogWriterOptions external;
        external.external_images = true;
        RawlogWriter writer(file, beginning_.rig, external);
        for (const Message& message : beginning_.messages) writer.write(message);
        writer.finish();
        deepen(fs::path(file).replace_extension().string() + "_Images", bits);
    }
    // Each value 255 becomes the largest of so many bits.
    static void deepen(const fs::path& folder, int bits) {
        for (const auto& entry : fs::directory_iterator(folder)) {
            cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
            image.convertTo(image, CV_16U, ((1 << bits) - 1) / 255.);
            cv::imwrite(entry.path().string(), image);
        }
    }
    // The largest difference of grey values, image by image.
    static double difference(const std::vector<ImageMessage>& a,
                             const std::vector<ImageMessage>& b) {
        EXPECT_EQ(a.size(), b.size());
        double largest = 0;
        for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
            largest = std::max(largest, cv::norm(a[i].image, b[i].image, cv::NORM_INF));
        return largest;
    }

    Written beginning_;
    ScratchFolder folder_;
};

// Of 16 bits the significant ones are taken, whatever their number, and the user is told.
TEST_F(ImageFaults, SignificantBitsOfSixteenAreFound) {
    write(beginning_, folder_ / "bytes.rawlog");
    const auto bytes = read_all<ImageMessage>(folder_ / "bytes.rawlog");
    for (const int bits : {8, 10, 12, 14, 16}) {
        const std::string file = folder_ / ("deep" + std::to_string(bits) + ".rawlog");
        write_deep(file, bits);
        EXPECT_LE(difference(read_all<ImageMessage>(file), bytes), 1) << bits;
        const ProgramResult info = program("info " + file);
        EXPECT_NE(info.out.find("16 bits, " + std::to_string(bits) + " of them significant"),
                  std::string::npos)
            << info.out;
    }
    const std::string file = folder_ / "deep12.rawlog";
    const ProgramResult stated = program("info " + file + " --bit-depth 12");
    EXPECT_EQ(stated.out.find("significant"), std::string::npos) << stated.out;
    RecordingOptions too_deep;
    too_deep.bit_depth = 16;
    Recording recording(file, too_deep);
    while (const auto message = recording.next())
        if (const auto* image = std::get_if<ImageMessage>(&*message)) {
            double largest = 0;
            cv::minMaxLoc(image->image, nullptr, &largest);
            EXPECT_LE(largest, 15);
        }
}

// So do the importers; what is beyond the bits that were found or stated is left out, never
// clipped.
TEST_F(ImageFaults, ImportersFindThemToo) {
    write(beginning_, folder_ / "bytes.rawlog");
    ASSERT_EQ(program("export " + (folder_ / "bytes.rawlog") + " --as asl -o " + (folder_ / "asl"))
                  .exit_code,
              0);
    deepen(folder_.path() / "asl/mav0/cam0/data", 12);
    const std::string import =
        "import asl " + (folder_ / "asl") + " -o " + (folder_ / "asl.rawlog");
    const ProgramResult found = program(import);
    EXPECT_EQ(found.exit_code, 0) << found.err;
    EXPECT_NE(found.out.find("16 bits, 12 of them significant"), std::string::npos) << found.out;
    EXPECT_LE(difference(read_all<ImageMessage>(folder_ / "asl.rawlog"),
                         read_all<ImageMessage>(folder_ / "bytes.rawlog")),
              1);
    const ProgramResult stated = program(import + " --bit-depth 10");
    expect_one_line(stated, {"values of more than 10 bits, which were stated", "--bit-depth"});
}

// One image of another size is left out; only the first speaks for the calibration.
TEST_F(ImageFaults, AnImageOfAnotherSize) {
    const auto images = [&] {
        std::vector<ImageMessage*> all;
        for (Message& message : beginning_.messages)
            if (auto* image = std::get_if<ImageMessage>(&message)) all.push_back(image);
        return all;
    }();
    const auto halve = [](ImageMessage& image) {
        cv::Mat half;
        cv::resize(image.image, half, {}, 0.5, 0.5);
        image.image = half;
    };
    const std::string file = folder_ / "recording.rawlog";
    halve(*images[10]);
    write(beginning_, file);
    EXPECT_EQ(read_all<ImageMessage>(file).size(), images.size() - 1);
    const ProgramResult tracked = program("track " + file + " -o " + (folder_ / "tracks.rawlog"));
    EXPECT_EQ(tracked.exit_code, 0) << tracked.err;
    EXPECT_NE(tracked.out.find("left out: 1 images"), std::string::npos) << tracked.out;
    EXPECT_NE(tracked.out.find("has 320x120 px, its calibration 640x240"), std::string::npos)
        << tracked.out;
    halve(*images[0]);
    write(beginning_, file);
    expect_one_line(program("track " + file + " -o " + (folder_ / "tracks.rawlog")),
                    {"320x120 px", "give the matching calibration"});
}

}  // namespace
}  // namespace vio::test
