// vio-slam import: data sets of other formats to a rawlog.
#include <cmath>
#include <iostream>
#include <map>
#include <memory>

#include "app/calibration_option.h"
#include "app/commands.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/base/angles.h"
#include "libvio/io/asl_import.h"
#include "libvio/io/csv_import.h"
#include "libvio/io/kitti_import.h"
#include "libvio/ros2/ros2_import.h"

namespace vio::app {
namespace {

constexpr const char* kExternalImages =
    "Leave the images as PNG files in NAME_Images beside the rawlog";

using Import = std::function<ImportReport(const std::function<void(double)>& progress)>;

void run(const std::string& output, const Import& import) {
    ImportReport report;
    {
        Progress progress("importing");
        report = import([&](double share) { progress.update(share); });
    }
    std::cout << output << ": " << report.images << " images, " << report.feature_frames
              << " feature frames, " << report.imu_readings << " IMU readings, ";
    if (report.gps_fixes > 0) std::cout << report.gps_fixes << " GPS fixes, ";
    std::cout << to_seconds(report.last - report.first) << " s\n";
    std::cout << std::flush;
    for (const std::string& remark : report.remarks) std::cout << remark << '\n';
    print_left_out(report.left_out);
    if (!report.truth_file.empty())
        std::cout << report.truth_file << ": " << report.truth_poses << " true poses (T_W_B)\n";
}

CLI::Option* add_output(CLI::App& command, std::string& output) {
    return command
        .add_option("-o,--output", output,
                    "Rawlog to write; ground truth goes beside it as NAME.truth.tum")
        ->required();
}

struct AslArguments {
    std::string dir, output;
    AslImportOptions options;
};

// ASL's layout and TUM-VI's, which differ in where the calibration stands.
void add_asl(CLI::App& import_command, const char* name, const char* help,
             ImportReport (*import)(const std::string&, const std::string&, const AslImportOptions&,
                                    const std::function<void(double)>&)) {
    CLI::App* command = import_command.add_subcommand(name, help);
    auto arguments = std::make_shared<AslArguments>();
    command->add_option("DIR", arguments->dir, "Folder that contains mav0/, or mav0 itself")
        ->required();
    add_output(*command, arguments->output);
    command->add_option("--camera", arguments->options.camera, "Camera folder")
        ->capture_default_str();
    command->add_option("--imu", arguments->options.imu,
                        "IMU folder; default: imu0, where there is one");
    add_bit_depth(*command, arguments->options.bit_depth);
    command->add_flag("--external-images", arguments->options.external_images, kExternalImages);
    command->callback([arguments, import] {
        run(arguments->output, [&](const auto& progress) {
            return import(arguments->dir, arguments->output, arguments->options, progress);
        });
    });
}

struct KittiArguments {
    std::string dir, output;
    KittiImportOptions options;
};

void add_kitti(CLI::App& import_command) {
    CLI::App* command = import_command.add_subcommand(
        "kitti", "Drive of KITTI's raw recordings: camera, OXTS as IMU, GPS and ground truth");
    auto arguments = std::make_shared<KittiArguments>();
    command
        ->add_option("DIR", arguments->dir,
                     "Folder of the drive, with image_0X/ and oxts/ (synced or unsynced)")
        ->required();
    add_output(*command, arguments->output);
    command->add_option("--camera", arguments->options.camera, "Camera folder")
        ->capture_default_str();
    command->add_option("--calibration-dir", arguments->options.calibration_dir,
                        "Folder with calib_*.txt; default: DIR or the one above it");
    add_bit_depth(*command, arguments->options.bit_depth);
    command->add_flag("--external-images", arguments->options.external_images, kExternalImages);
    command->callback([arguments] {
        run(arguments->output, [&](const auto& progress) {
            return import_kitti(arguments->dir, arguments->output, arguments->options, progress);
        });
    });
}

struct CsvArguments {
    std::string output;
    CsvImportOptions options;
    std::string time_unit = "s", image_time_unit, gyro_unit = "rad/s", accel_unit = "m/s^2";
    bool accel_reversed = false;
};

ImportReport import_tables(const CsvArguments& arguments,
                           const std::function<void(double)>& progress) {
    constexpr double kStandardGravity = 9.80665;
    CsvImportOptions options = arguments.options;
    options.gyro.time_unit = options.accel.time_unit = options.images.time_unit =
        arguments.time_unit;
    if (!arguments.image_time_unit.empty()) options.images.time_unit = arguments.image_time_unit;
    options.gyro_unit = arguments.gyro_unit == "deg/s" ? kDegree : 1;
    options.accel_unit =
        (arguments.accel_unit == "g" ? kStandardGravity : 1) * (arguments.accel_reversed ? -1 : 1);
    return import_csv(arguments.output, options, progress);
}

void add_table(CLI::App& command, const std::string& name, CsvTable& table, const char* file_help,
               const char* columns_help) {
    CLI::Option* file = command.add_option("--" + name, table.file, file_help);
    command.add_option("--" + name + "-columns", table.columns, columns_help)
        ->delimiter(',')
        ->allow_extra_args(false)
        ->needs(file);
}

void add_csv(CLI::App& import_command) {
    CLI::App* command = import_command.add_subcommand(
        "csv", "Tables of IMU readings and images, their columns named here (phones, loggers)");
    auto arguments = std::make_shared<CsvArguments>();
    CsvImportOptions& options = arguments->options;
    options.gyro.columns = {"1", "2", "3", "4", "5", "6", "7"};
    options.accel.columns = {"1", "2", "3", "4"};
    options.images.columns = {"1", "2"};
    add_output(*command, arguments->output);
    add_table(*command, "imu", options.gyro,
              "Table of IMU readings, or of the gyro's where the accelerometer has its own",
              "Time, gyro x,y,z and accelerometer x,y,z by name or number from 1, separated by "
              "commas; default: 1,2,3,4,5,6,7");
    add_table(*command, "accel", options.accel,
              "Table of accelerometer readings, interpolated at the gyro's times",
              "Time and accelerometer x,y,z; default: 1,2,3,4");
    add_table(*command, "images", options.images, "Table of images",
              "Time and file; or time alone, for the files of --images-dir by name; default: 1,2");
    command->add_option("--images-dir", options.images_dir,
                        "Folder of the image files; default: that of their table");
    command->add_option("--time-unit", arguments->time_unit, "Of the stamps")
        ->check(CLI::IsMember({"s", "ms", "us", "ns"}))
        ->capture_default_str();
    command
        ->add_option("--image-time-unit", arguments->image_time_unit,
                     "Of the images' stamps; default: as --time-unit")
        ->check(CLI::IsMember({"s", "ms", "us", "ns"}));
    command->add_option("--gyro-unit", arguments->gyro_unit, "Of the gyro's readings")
        ->check(CLI::IsMember({"rad/s", "deg/s"}))
        ->capture_default_str();
    command
        ->add_option("--accel-unit", arguments->accel_unit,
                     "Of the accelerometer's readings; g: 9.80665 m/s^2")
        ->check(CLI::IsMember({"m/s^2", "g"}))
        ->capture_default_str();
    command->add_flag("--accel-reversed", arguments->accel_reversed,
                      "The readings show -g upwards at rest (iOS)");
    add_calibration_option(*command, options.calibration_files);
    add_bit_depth(*command, options.bit_depth);
    command->add_flag("--external-images", options.external_images, kExternalImages);
    command->callback([arguments, gyro = options.gyro.columns] {
        // A separate accelerometer leaves the gyro's first four columns.
        CsvTable& table = arguments->options.gyro;
        if (!arguments->options.accel.file.empty() && table.columns == gyro)
            table.columns.resize(4);
        run(arguments->output,
            [&](const auto& progress) { return import_tables(*arguments, progress); });
    });
}

struct Ros2Arguments {
    std::string bag, output;
    Ros2ImportOptions options;
};

void add_ros2(CLI::App& import_command) {
    CLI::App* command = import_command.add_subcommand(
        "ros2", "ROS 2 bag: image and IMU topics, CameraInfo, /tf_static, GPS, true poses");
    auto arguments = std::make_shared<Ros2Arguments>();
    Ros2ImportOptions& options = arguments->options;
    command->add_option("BAG", arguments->bag, "Folder with metadata.yaml, or a .db3 or .mcap file")
        ->required();
    add_output(*command, arguments->output);
    command->add_option("--image-topic", options.image_topic,
                        "Image or CompressedImage; default: the only one");
    CLI::Option* imu =
        command->add_option("--imu-topic", options.imu_topic, "Imu; default: the only one");
    command
        ->add_option("--accel-topic", options.accel_topic,
                     "Imu of an accelerometer with a topic of its own, interpolated at the times "
                     "of --imu-topic, which is then the gyro's")
        ->needs(imu);
    command->add_option("--gps-topic", options.gps_topic, "NavSatFix; default: the only one");
    command->add_option("--truth-topic", options.truth_topic,
                        "True poses: PoseStamped, PoseWithCovarianceStamped, TransformStamped or "
                        "Odometry");
    add_calibration_option(*command, options.calibration_files);
    add_bit_depth(*command, options.bit_depth);
    command->add_flag("--external-images", options.external_images, kExternalImages);
    command->callback([arguments] {
        run(arguments->output, [&](const auto& progress) {
            return import_ros2(arguments->bag, arguments->output, arguments->options, progress);
        });
    });
}

}  // namespace

void add_import(CLI::App& program) {
    CLI::App* command = program.add_subcommand("import", "Convert a data set to a rawlog");
    command->require_subcommand(1);
    add_asl(*command, "asl", "EuRoC/ASL folder: camera (images or features), IMU, ground truth",
            import_asl);
    add_asl(*command, "tum-vi",
            "TUM-VI folder (EuRoC/DSO export): fisheye camera, IMU, motion capture", import_tum_vi);
    add_kitti(*command);
    add_ros2(*command);
    add_csv(*command);
}

}  // namespace vio::app
