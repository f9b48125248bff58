// vio-slam render: pictures of results and scenes.
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/errors.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string source, output, view = "iso", size = "1280x720";
    SnapshotOptions options;
};

void parse_size(const std::string& size, SnapshotOptions& options) {
    char rest = 0;
    if (std::sscanf(size.c_str(), "%dx%d%c", &options.width, &options.height, &rest) != 2 ||
        options.width < 64 || options.height < 64 || options.width > 8192 ||
        options.height > 8192 || options.width % 4 != 0)
        throw InputError("--size " + size +
                         ": expected WxH in pixels, 64 to 8192, the width a multiple of 4");
}

void run(Arguments arguments) {
    parse_size(arguments.size, arguments.options);
    arguments.options.view = *parse_view(arguments.view);
    std::string file = arguments.source;
    if (std::filesystem::is_directory(file)) file += "/scene.3Dscene";
    const Snapshot snapshot = render_snapshot(load_scene(file), arguments.options);
    if (!snapshot.problem.empty()) throw InputError(snapshot.problem);
    save_image(snapshot.image, arguments.output);
    std::cout << arguments.output << "\n";
}

}  // namespace

void add_render(CLI::App& program) {
    CLI::App* command = program.add_subcommand("render", "Picture of a result, without a display");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("SOURCE", arguments->source, "Results folder, or .3Dscene file")
        ->required();
    command->add_option("-o,--output", arguments->output, "Picture to write (PNG)")->required();
    command->add_option("--view", arguments->view, "Where to look from")
        ->check(CLI::IsMember({"iso", "top", "side", "chase"}))
        ->capture_default_str();
    command->add_option("--size", arguments->size, "Width x height [px]")->capture_default_str();
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
