// vio-slam info: what a rawlog holds and how its sensors are calibrated.
#include <memory>

#include "app/commands.h"
#include "app/recording_text.h"
#include "libvio/base/errors.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string rawlog;
    RecordingOptions recording;
};

void run(const Arguments& arguments) {
    const std::string damage = print_streams(arguments.rawlog);
    print_calibration(Recording(arguments.rawlog, arguments.recording));
    if (!damage.empty()) throw InputError(damage);
}

}  // namespace

void add_info(CLI::App& program) {
    CLI::App* command =
        program.add_subcommand("info", "Streams, rates, gaps and calibration of a rawlog");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RAWLOG", arguments->rawlog, "MRPT rawlog")->required();
    add_recording_options(*command, arguments->recording);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
