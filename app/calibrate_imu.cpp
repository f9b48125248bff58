// vio-slam calibrate imu: an IMU's noise from a recording at rest.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "app/calibrate.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/base/errors.h"
#include "libvio/calibration/allan_deviation.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/recording.h"
#include "libvio/io/sensor_text.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string input, output, label;
    bool curve = false;
};

bool is_table(const std::string& file) {
    return file.ends_with(".csv") || file.ends_with(".csv.gz");
}

std::vector<ImuReading> read_rawlog(const std::string& file, const std::string& label) {
    RecordingOptions options;
    options.imu_label = label;
    Recording recording(file, options);
    Progress progress("reading");
    std::vector<ImuReading> readings;
    while (const auto message = recording.next()) {
        if (const auto* reading = std::get_if<ImuReading>(&*message)) readings.push_back(*reading);
        progress.update(recording.progress());
    }
    print_left_out(recording.left_out());
    if (readings.empty()) throw InputError(file + ": holds no IMU readings (CObservationIMU)");
    return readings;
}

std::string with_sigma(const Estimated& e) {
    char text[64];
    if (e.determined)
        std::snprintf(text, sizeof text, "%.3e +- %.1e", e.value, e.sigma);
    else
        std::snprintf(text, sizeof text, "below %.3e", e.bound);
    return text;
}

void print(const char* name, const ImuNoiseEstimate::Sensor& sensor, const char* unit) {
    std::printf("%s, unit u = %s\n", name, unit);
    std::printf("  %-5s %-24s %-24s %-24s %s\n", "", "white noise u/sqrt(Hz)", "instability u",
                "random walk u/s/sqrt(Hz)", "misfit");
    const auto row = [](const char* axis, const AllanFit& fit) {
        std::printf(
            "  %-5s %-24s %-24s %-24s %.1f\n", axis, with_sigma(fit.noise_density).c_str(),
            fit.bias_instability.value > 0 ? with_sigma(fit.bias_instability).c_str() : "none seen",
            with_sigma(fit.random_walk).c_str(), fit.misfit);
    };
    const char* axes[] = {"x", "y", "z"};
    for (size_t i = 0; i < 3; ++i) row(axes[i], sensor.axes[i]);
    row("all", sensor.all);
}

void print_curve(const ImuNoiseEstimate& e) {
    std::printf("Allan deviation (rms of the three axes)\n  %12s %14s %14s %10s\n", "tau s",
                "gyro rad/s", "accel m/s^2", "1 sigma");
    for (size_t i = 0; i < e.gyro.levels.size(); ++i)
        std::printf("  %12.4f %14.6e %14.6e %9.1f%%\n", e.gyro.levels[i].tau,
                    std::sqrt(e.gyro.levels[i].variance), std::sqrt(e.accel.levels[i].variance),
                    100 / std::sqrt(2 * e.gyro.levels[i].pairs));
}

std::string preset_text(const ImuNoiseEstimate& e, const std::string& input) {
    std::string text = "# Noise of an IMU at rest, measured by vio-slam calibrate imu: " +
                       std::filesystem::path(input).filename().string() + ", " +
                       std::to_string(std::lround(to_seconds(e.last - e.first))) + " s at " +
                       std::to_string(std::lround(e.rate)) + " Hz.\n";
    for (const std::string& warning : e.warnings) text += "# Warning: " + warning + ".\n";
    return text +
           "# Errors that follow the motion (scale, alignment, vibration) show only in motion: "
           "where a\n"
           "# run's errors exceed its covariances, multiply the densities by 3 to 10.\n" +
           noise_text(e.noise);
}

void calibrate(const Arguments& arguments) {
    const auto readings = is_table(arguments.input) ? read_imu(arguments.input)
                                                    : read_rawlog(arguments.input, arguments.label);
    ImuNoiseEstimate e;
    try {
        e = estimate_imu_noise(readings);
    } catch (const InputError& reason) {
        throw InputError(arguments.input + ": " + reason.what());
    }
    for (const std::string& warning : e.warnings) std::printf("warning     %s\n", warning.c_str());
    std::printf("used        %.0f s at rest, %.1f readings a second\n",
                to_seconds(e.last - e.first), e.rate);
    print("gyro", e.gyro, "rad/s");
    print("accelerometer", e.accel, "m/s^2");
    if (arguments.curve) print_curve(e);
    write_text(arguments.output, preset_text(e, arguments.input));
    std::printf("calibration %s\n", arguments.output.c_str());
}

}  // namespace

void add_calibrate_imu(CLI::App& command) {
    CLI::App* imu = command.add_subcommand(
        "imu", "Noise of an IMU (Allan deviation), from a recording of hours at rest");
    auto arguments = std::make_shared<Arguments>();
    imu->add_option("FILE", arguments->input,
                    "Rawlog, or table t[ns],wx,wy,wz,ax,ay,az (.csv[.gz], as ASL's imu0/data.csv)")
        ->required();
    imu->add_option("-o,--output", arguments->output,
                    "Calibration file to write, for --calibration of the other commands")
        ->required();
    imu->add_option("--imu-label", arguments->label,
                    "IMU to use; default: the first in the rawlog");
    imu->add_flag("--curve", arguments->curve, "Print the Allan deviation at each averaging time");
    imu->callback([arguments] { calibrate(*arguments); });
}

}  // namespace vio::app
