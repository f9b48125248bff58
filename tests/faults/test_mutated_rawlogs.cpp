// The program on rawlogs in which bytes were changed, cut out, doubled or exchanged: a result or
// one clear line, whatever they hold. VIO_MUTATIONS says how many (tests/fuzz/mutated.sh: 1000,
// with the sanitizers), VIO_FIRST_MUTATION where to begin.
#include <gtest/gtest.h>

#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <utility>

#include "tests/faults/recordings.h"

namespace vio::test {
namespace {

class Mutator {
 public:
    explicit Mutator(std::uint64_t seed) : state_(seed * 2 + 1) {}

    // One to eight changes. Most leave the compression alone, whose checksum would tell all of them
    // from each other: the caller compresses afterwards, or not at all.
    std::string mutate(std::string bytes) {
        for (std::uint64_t changes = 1 + below(8); changes > 0 && bytes.size() > 64; --changes) {
            const std::size_t at = below(bytes.size() - 32), length = 1 + below(32);
            switch (below(6)) {
                case 0:
                    bytes[at] = static_cast<char>(below(256));
                    break;
                case 1:
                    bytes[at] ^= static_cast<char>(1 << below(8));
                    break;
                case 2:
                    bytes.erase(at, length);
                    break;
                case 3:
                    bytes.insert(at, bytes.substr(at, length));
                    break;
                case 4:  // a number or a length becomes extreme
                    std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), 1 + below(8),
                                below(2) ? '\xff' : '\0');
                    break;
                default:
                    bytes.resize(at + 32);
                    break;
            }
        }
        return bytes;
    }

    std::uint64_t below(std::uint64_t limit) {
        state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
        return (state_ >> 33) % limit;
    }

 private:
    std::uint64_t state_;
};

std::string uncompressed(const std::string& file) {
    std::string bytes;
    gzFile in = gzopen(file.c_str(), "rb");
    char buffer[65536];
    for (int got; (got = gzread(in, buffer, sizeof buffer)) > 0;)
        bytes.append(buffer, static_cast<std::size_t>(got));
    gzclose(in);
    return bytes;
}

// Two seconds of features, or of small images.
std::string small_recording(const ScratchFolder& folder, bool images) {
    std::vector<std::string> changes{"camera.count=40", "camera.width=160", "camera.height=120",
                                     "camera.intrinsics=115 115 79.5 59.5"};
    if (images) changes.insert(changes.end(), {"images.render=true", "camera.count=10"});
    const Simulation simulation(ScenarioOptions::from_file(
        std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini", changes));
    Written recording = as_written(simulation);
    int image = 0;
    if (images)
        for (Message& message : recording.messages)
            if (const auto* frame = std::get_if<FeatureFrame>(&message))
                message = ImageMessage{frame->t, simulation.image(image++)};
    write(recording, folder / "small.rawlog");
    return uncompressed(folder / "small.rawlog");
}

// vio-slam without what the sanitizers say that is no finding: that an allocation was refused, as
// damaged lengths deserve; and that the leak checker itself came to grief, which now and then it
// does after thousands of processes, where another look is taken without it.
ProgramResult judged_run(const std::string& arguments, const std::string& folder) {
    ProgramResult result = vio_slam(arguments, folder, "exec timeout 60");
#ifdef VIO_SANITIZE
    if (result.err.find("LeakSanitizer has encountered a fatal error") != std::string::npos)
        result = vio_slam(arguments, folder,
                          "ASAN_OPTIONS=\"$ASAN_OPTIONS:detect_leaks=0\" exec timeout 60");
    std::istringstream lines(std::exchange(result.err, {}));
    for (std::string line; std::getline(lines, line);)
        if (line.find("WARNING: AddressSanitizer failed to allocate") == std::string::npos)
            result.err += line + '\n';
#endif
    return result;
}

TEST(MutatedRawlogs, GiveAResultOrOneLine) {
    const auto stated = [](const char* name, int otherwise) {
        const char* value = std::getenv(name);
        return value ? std::atoi(value) : otherwise;
    };
    const int first = stated("VIO_FIRST_MUTATION", 0), count = stated("VIO_MUTATIONS", 12);
    const ScratchFolder folder;
    const std::string recordings[] = {small_recording(folder, false),
                                      small_recording(folder, true)};
    const std::string file = folder / "mutated.rawlog";
    int results = 0, lines = 0;
    for (int i = first; i < first + count; ++i) {
        Mutator mutator(static_cast<std::uint64_t>(i));
        std::ofstream(file, std::ios::binary) << mutator.mutate(recordings[i % 2]);
        const std::string command =
            i % 4 < 2 ? "run " + file + " --overwrite -o " + (folder / "out") : "check " + file;
        const ProgramResult result = judged_run(command, folder.path().string());
        const std::string what = "mutation " + std::to_string(i) + ": " + result.err;
        ASSERT_TRUE(result.exit_code == 0 || result.exit_code == 1)
            << what << " exit code " << result.exit_code;
        (result.exit_code == 0 ? results : lines)++;
        if (result.exit_code == 0) continue;
        ASSERT_EQ(result.err.rfind("vio-slam: error: ", 0), 0u) << what;
        ASSERT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << what;
        ASSERT_EQ(result.err.find("unexpected: "), std::string::npos) << what;
    }
    RecordProperty("results", results);
    RecordProperty("lines", lines);
    std::printf("%d mutated rawlogs: %d results, %d lines of error\n", count, results, lines);
}

}  // namespace
}  // namespace vio::test
