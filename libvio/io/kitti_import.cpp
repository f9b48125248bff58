#include "libvio/io/kitti_import.h"

#include <array>
#include <chrono>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/camera/perspective.h"
#include "libvio/geometry/geodetic.h"
#include "libvio/io/kitti_calibration.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

struct Stamp {
    TimeNs t = 0;
    std::string place;
};

std::vector<Stamp> read_stamps(const fs::path& file) {
    std::vector<Stamp> stamps;
    TextRows row(file.string());
    while (row.next()) {
        const auto t =
            row.size() == 2
                ? parse_date_time(std::string(row.text(0)) + " " + std::string(row.text(1)))
                : std::nullopt;
        if (!t) throw row.error("is no stamp; expected YYYY-MM-DD hh:mm:ss.fffffffff");
        stamps.push_back({*t, row.place()});
    }
    if (stamps.empty()) throw InputError(file.string() + ": holds no stamps");
    return stamps;
}

std::string numbered(size_t index, const char* extension) {
    const std::string digits = std::to_string(index);
    return std::string(10 - std::min<size_t>(10, digits.size()), '0') + digits + extension;
}

// What is taken of a packet of the OXTS unit, by the names of dataformat.txt.
enum Field { kLat, kLon, kAlt, kRoll, kPitch, kYaw, kAx, kAy, kAz, kWx, kWy, kWz, kPosMode };
constexpr std::array<const char*, 13> kFieldNames = {
    "lat", "lon", "alt", "roll", "pitch", "yaw", "ax", "ay", "az", "wx", "wy", "wz", "posmode"};
using FieldColumns = std::array<size_t, kFieldNames.size()>;

// Lines "name: meaning", one a value.
FieldColumns read_data_format(const fs::path& file) {
    // KITTI's order, should the file be missing.
    FieldColumns columns = {0, 1, 2, 3, 4, 5, 11, 12, 13, 17, 18, 19, 27};
    if (!is_there(file)) return columns;
    std::map<std::string, size_t> named;
    TextRows row(file.string());
    while (row.next()) {
        const std::string name(row.text(0));
        named.emplace(name.substr(0, name.find(':')), named.size());
    }
    for (size_t i = 0; i < columns.size(); ++i) {
        const auto found = named.find(kFieldNames[i]);
        if (found == named.end())
            throw InputError(file.string() + ": names no value '" + kFieldNames[i] + "'");
        columns[i] = found->second;
    }
    return columns;
}

struct Oxts {
    std::vector<ImuReading> imu;
    std::vector<GpsMessage> gps;
    std::vector<TimedPose> truth;
    LeftOutList left_out;
};

Eigen::Matrix3d rotation(double roll, double pitch, double yaw) {
    return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
            Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
            Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
        .toRotationMatrix();
}

// OXTS's kind of solution as NMEA's quality of a fix: alone, differential, RTK float and integer.
int fix_quality(double position_mode) {
    if (position_mode == 6) return 4;
    if (position_mode == 5) return 5;
    if (position_mode == 4) return 2;
    return position_mode >= 3 ? 1 : 0;
}

Oxts read_oxts(const fs::path& dir) {
    const FieldColumns columns = read_data_format(dir / "dataformat.txt");
    Oxts oxts;
    std::optional<Geodetic> origin;
    const auto stamps = read_stamps(dir / "timestamps.txt");
    for (size_t i = 0; i < stamps.size(); ++i) {
        const TimeNs t = stamps[i].t;
        if (!oxts.truth.empty() && t <= oxts.truth.back().t) {
            oxts.left_out.add("OXTS packets whose stamps do not increase", stamps[i].place);
            continue;
        }
        TextRows row((dir / "data" / numbered(i, ".txt")).string());
        if (!row.next()) throw InputError(row.file() + ": is empty; expected a packet of values");
        row.require(*std::max_element(columns.begin(), columns.end()) + 1);
        std::array<double, kFieldNames.size()> v{};
        try {
            for (size_t f = 0; f < v.size(); ++f) v[f] = row.number(columns[f]);
        } catch (const UnusableMeasurement& reason) {
            oxts.left_out.add("OXTS packets", reason.what());
            continue;
        }
        oxts.imu.push_back({t, {v[kWx], v[kWy], v[kWz]}, {v[kAx], v[kAy], v[kAz]}});
        oxts.gps.push_back({t, v[kLat], v[kLon], v[kAlt], fix_quality(v[kPosMode])});
        const Geodetic place{v[kLat], v[kLon], v[kAlt]};
        if (!origin) origin = place;
        oxts.truth.push_back(
            {t, {rotation(v[kRoll], v[kPitch], v[kYaw]), enu_from_geodetic(place, *origin)}});
    }
    return oxts;
}

std::vector<ImageFile> read_images(const fs::path& dir) {
    std::vector<ImageFile> files;
    for (const Stamp& stamp : read_stamps(dir / "timestamps.txt"))
        files.push_back({stamp.t, dir / "data" / numbered(files.size(), ".png"), stamp.place});
    return files;
}

fs::path calibration_folder(const fs::path& drive, const std::string& given) {
    if (!given.empty()) return given;
    for (const fs::path& folder : {drive, drive.parent_path()})
        if (is_there(folder / "calib_cam_to_cam.txt")) return folder;
    throw InputError(drive.string() +
                     ": no calib_cam_to_cam.txt here or above; unpack the day's calib.zip there or "
                     "name its folder with --calibration-dir");
}

}  // namespace

std::optional<TimeNs> parse_date_time(std::string_view text) {
    using namespace std::chrono;
    if (text.size() < 19 || text[4] != '-' || text[7] != '-' || text[10] != ' ' ||
        text[13] != ':' || text[16] != ':')
        return {};
    const auto number = [&](size_t begin, size_t length) {
        return parse_integer(text.substr(begin, length));
    };
    const auto y = number(0, 4), m = number(5, 2), d = number(8, 2), h = number(11, 2),
               min = number(14, 2);
    const auto seconds_of_minute = parse_seconds(text.substr(17));
    if (!y || !m || !d || !h || !min || !seconds_of_minute) return {};
    const year_month_day date(year(static_cast<int>(*y)), month(static_cast<unsigned>(*m)),
                              day(static_cast<unsigned>(*d)));
    if (!date.ok() || *y < 1970 || *y > 2115 || *h < 0 || *h > 23 || *min < 0 || *min > 59 ||
        *seconds_of_minute < 0 || *seconds_of_minute >= from_seconds(61))
        return {};
    const nanoseconds since = sys_days(date).time_since_epoch() + hours(*h) + minutes(*min);
    return since.count() + *seconds_of_minute;
}

ImportReport import_kitti(const std::string& dir, const std::string& out_rawlog,
                          const KittiImportOptions& options,
                          const std::function<void(double)>& progress) {
    if (!is_folder(dir))
        throw InputError(dir + ": no such folder; name a drive of KITTI's raw recordings");
    const fs::path drive = fs::canonical(dir);
    auto images = read_images(drive / options.camera);
    const cv::Mat first = cv::imread(images.front().path.string(), cv::IMREAD_UNCHANGED);
    if (first.empty())
        throw images.front().error("image " + images.front().path.string() +
                                   " is missing or damaged");
    Oxts oxts = read_oxts(drive / "oxts");
    const Rig rig = read_kitti_calibration(
        calibration_folder(drive, options.calibration_dir).string(),
        options.camera.substr(options.camera.find_last_of('_') + 1), first.cols, first.rows);

    RawlogWriterOptions writer_options;
    writer_options.camera_label = options.camera;
    writer_options.imu_label = "oxts";
    writer_options.external_images = options.external_images;
    ImportReport report;
    report.left_out = std::move(oxts.left_out);
    MeasurementSources sources;
    const std::string name = (drive / "oxts").string();
    sources.push_back(std::make_unique<StoredSource<ImuReading>>(std::move(oxts.imu), name));
    sources.push_back(std::make_unique<StoredSource<GpsMessage>>(std::move(oxts.gps), name));
    sources.push_back(image_file_source(std::move(images), options.bit_depth, report.remarks));
    RawlogWriter writer(out_rawlog, rig, writer_options);
    merge_sources(std::move(sources), writer, report, progress);
    write_truth(out_rawlog, oxts.truth, report);
    writer.finish();
    return report;
}

}  // namespace vio
