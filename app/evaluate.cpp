// vio-slam evaluate: a result against the truth.
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "libvio/evaluation/evaluate.h"
#include "libvio/io/recording.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string result, truth, rawlog;
    std::string alignment = "se3";
    EvaluationOptions options;
    bool json = false;
};

AlignmentKind alignment_kind(const std::string& name) {
    if (name == "none") return AlignmentKind::kNone;
    if (name == "yaw") return AlignmentKind::kYawPosition;
    return name == "se3" ? AlignmentKind::kSE3 : AlignmentKind::kSim3;
}

std::vector<TimeNs> image_stamps(const std::string& rawlog) {
    std::vector<TimeNs> stamps;
    Recording recording(rawlog);
    while (const auto message = recording.next()) {
        if (const auto* image = std::get_if<ImageMessage>(&*message)) stamps.push_back(image->t);
        if (const auto* frame = std::get_if<FeatureFrame>(&*message)) stamps.push_back(frame->t);
    }
    return stamps;
}

// Images of the recording that a results folder was made from; 0 where it does not say.
int image_count(const std::string& folder) {
    std::ifstream file(folder + "/summary.json");
    const auto summary = nlohmann::json::parse(file, nullptr, false);
    return summary.is_object() ? summary.value("images_in_recording", 0) : 0;
}

Evaluation evaluate_result(const Arguments& arguments) {
    EvaluationOptions options = arguments.options;
    options.alignment = alignment_kind(arguments.alignment);
    options.estimate_name = arguments.result;
    options.truth_name = arguments.truth;
    if (!arguments.rawlog.empty()) options.images.stamps = image_stamps(arguments.rawlog);
    const std::vector<TimedPose> truth = read_trajectory(arguments.truth);
    if (!std::filesystem::is_directory(arguments.result))
        return evaluate(read_trajectory(arguments.result), truth, options);

    options.images.image_count = image_count(arguments.result);
    std::vector<TimedPose> poses;
    std::vector<Matrix6d> covariances;
    for (const StateEstimate& state : read_results(arguments.result).states) {
        poses.push_back({state.t, state.T_W_B});
        covariances.push_back(state.covariance.topLeftCorner<6, 6>());
    }
    return evaluate(poses, truth, options, covariances);
}

void run(const Arguments& arguments) {
    const Evaluation evaluation = evaluate_result(arguments);
    if (arguments.json)
        std::cout << to_json(evaluation).dump(2) << "\n";
    else
        std::cout << to_text(evaluation);
}

}  // namespace

void add_evaluate(CLI::App& program) {
    CLI::App* command = program.add_subcommand("evaluate", "Compare a result with the truth");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RESULT", arguments->result, "Results folder, or trajectory (TUM or EuRoC)")
        ->required();
    command->add_option("--truth", arguments->truth, "True trajectory (TUM or EuRoC)")->required();
    command->add_option("--align", arguments->alignment, "Alignment before errors are taken")
        ->check(CLI::IsMember({"none", "yaw", "se3", "sim3"}))
        ->capture_default_str();
    command->add_option("--rawlog", arguments->rawlog,
                        "Recording of the result: completion is counted against its images");
    command
        ->add_option("--start-offset", arguments->options.images.start_offset_s,
                     "Images up to this long after the first need no pose [s]")
        ->needs("--rawlog")
        ->check(CLI::NonNegativeNumber);
    command
        ->add_option("--max-gap", arguments->options.max_gap_s,
                     "Widest gap in the truth that is interpolated over [s]")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command->add_option("--time-offset", arguments->options.time_offset_s,
                        "Truth's stamp minus estimate's [s]");
    command->add_flag("--json", arguments->json, "Machine-readable");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
