#include "libvio/io/csv_import.h"

#include <algorithm>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/accelerometer_stream.h"
#include "libvio/io/calibration_file.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReadings = "IMU readings";

std::string_view unquoted(std::string_view text) {
    if (text.size() >= 2 && text.front() == '"' && text.back() == '"')
        text = trimmed(text.substr(1, text.size() - 2));
    return text;
}

// Nothing for a text that is no number.
std::optional<TimeNs> parse_time(std::string_view text, const std::string& unit) {
    text = unquoted(text);
    if (unit == "s") return parse_seconds(text);
    if (text.find_first_of("eE") != std::string_view::npos) {
        const auto value = parse_double(text);
        const double scale = unit == "ms" ? 1e6 : unit == "us" ? 1e3 : 1;
        if (!value || std::abs(*value * scale) > 9e18) return {};
        return static_cast<TimeNs>(std::llround(*value * scale));
    }
    const char* exponent = unit == "ms" ? "e-3" : unit == "us" ? "e-6" : "e-9";
    return parse_seconds(std::string(text) + exponent);
}

// The chosen columns of a table, row by row, in order of time.
class TableRows {
 public:
    // Rows with the stamp of the one before are passed over and added to left_out.
    TableRows(const CsvTable& table, LeftOutList& left_out)
        : table_(table), left_out_(left_out), row_(table.file) {
        if (!row_.next()) throw InputError(table.file + ": holds no rows");
        names_row_ = !parse_double(unquoted(row_.text(0)));
        for (const std::string& column : table.columns) columns_.push_back(find(column));
        needed_ = 1 + *std::max_element(columns_.begin(), columns_.end());
        fresh_ = !names_row_;
    }

    bool next() {
        while (fresh_ || row_.next()) {
            fresh_ = false;
            row_.require(needed_);
            const auto t = parse_time(row_.text(columns_[0]), table_.time_unit);
            if (!t)
                throw row_.error("'" + std::string(row_.text(columns_[0])) +
                                 "' is no time; is the column right?");
            if (started_ && *t < t_)
                throw row_.error("the time stamp is before that of the row before; sort the rows");
            const bool repeated = started_ && *t == t_;
            started_ = true;
            t_ = *t;
            if (!repeated) return true;
            left_out_.add("rows with a repeated stamp", row_.place());
        }
        return false;
    }

    TimeNs time() const { return t_; }
    size_t size() const { return columns_.size(); }
    std::string text(size_t column) const {
        return std::string(unquoted(row_.text(columns_[column])));
    }
    double number(size_t column) const {
        return row_.number(unquoted(row_.text(columns_[column])));
    }
    Eigen::Vector3d vector(size_t column) const {
        return {number(column), number(column + 1), number(column + 2)};
    }
    double progress() const { return row_.progress(); }
    std::string place() const { return row_.place(); }
    InputError error(const std::string& problem) const { return row_.error(problem); }

 private:
    size_t find(const std::string& column) const {
        std::string names;
        for (size_t i = 0; names_row_ && i < row_.size(); ++i) {
            const std::string name(unquoted(row_.text(i)));
            if (name == column) return i;
            names += (i ? ", " : "") + name;
        }
        if (const auto number = parse_integer(column); number && *number > 0)
            return static_cast<size_t>(*number - 1);
        throw InputError(table_.file + ": has no column '" + column + "'; " +
                         (names_row_ ? "it has " + names : "it names none: give numbers, from 1"));
    }

    CsvTable table_;
    LeftOutList& left_out_;
    TextRows row_;
    std::vector<size_t> columns_;
    size_t needed_ = 0;
    bool names_row_ = false, fresh_ = false, started_ = false;
    TimeNs t_ = 0;
};

class CsvImuSource final : public MeasurementSource {
 public:
    explicit CsvImuSource(const CsvImportOptions& options)
        : gyro_(options.gyro, left_out_),
          gyro_unit_(options.gyro_unit),
          accel_unit_(options.accel_unit) {
        if (options.accel.file.empty()) return;
        accel_ = std::make_unique<TableRows>(options.accel, left_out_);
        accel_stream_.emplace([this] { return next_accel(); });
    }

    bool advance() override {
        while (gyro_.next()) {
            if (!read_row()) continue;
            set_time(reading_.t, gyro_);
            return true;
        }
        return false;
    }

    double progress() const override { return gyro_.progress(); }

 private:
    const char* what() const override { return kReadings; }
    Message message() override { return reading_; }

    // False where the row gives no reading, which is noted.
    bool read_row() {
        try {
            reading_.t = gyro_.time();
            reading_.gyro = gyro_unit_ * gyro_.vector(1);
            if (!accel_) reading_.accel = accel_unit_ * gyro_.vector(4);
        } catch (const UnusableMeasurement& reason) {
            left_out_.add(kReadings, reason.what());
            return false;
        }
        if (!accel_) return true;
        const auto accel = accel_stream_->at(reading_.t);
        if (accel)
            reading_.accel = *accel;
        else
            left_out_.add(kGyroAlone, gyro_.place());
        return accel.has_value();
    }

    std::optional<AccelerometerStream::Reading> next_accel() {
        while (accel_->next()) {
            try {
                return {{accel_->time(), accel_unit_ * accel_->vector(1)}};
            } catch (const UnusableMeasurement& reason) {
                left_out_.add("accelerometer readings", reason.what());
            }
        }
        return {};
    }

    TableRows gyro_;
    double gyro_unit_, accel_unit_;
    std::unique_ptr<TableRows> accel_;
    std::optional<AccelerometerStream> accel_stream_;
    ImuReading reading_;
};

std::vector<fs::path> files_by_name(const fs::path& dir) {
    if (!is_folder(dir)) throw InputError(dir.string() + ": no such folder of images");
    std::set<fs::path> files;
    for (const auto& entry : fs::directory_iterator(dir))
        if (entry.is_regular_file()) files.insert(entry.path());
    return {files.begin(), files.end()};
}

std::vector<ImageFile> read_images(const CsvImportOptions& options) {
    fs::path dir = options.images_dir;
    if (dir.empty()) dir = fs::path(options.images.file).parent_path();
    LeftOutList repeated;
    TableRows rows(options.images, repeated);
    const bool named = rows.size() > 1;
    std::vector<fs::path> files;
    if (!named) files = files_by_name(dir);
    std::vector<ImageFile> images;
    while (rows.next()) {
        if (!named && images.size() == files.size())
            throw rows.error("there are only " + std::to_string(files.size()) + " files in " +
                             dir.string());
        images.push_back(
            {rows.time(), named ? dir / rows.text(1) : files[images.size()], rows.place()});
    }
    if (!repeated.empty())
        throw InputError(options.images.file + ": " + std::to_string(repeated.total()) +
                         " images have the time stamp of the one before; is the unit right?");
    if (!named && images.size() != files.size())
        throw InputError(options.images.file + ": has " + std::to_string(images.size()) +
                         " stamps for " + std::to_string(files.size()) + " files in " +
                         dir.string());
    return images;
}

void require_columns(const CsvTable& table, std::initializer_list<size_t> counts,
                     const char* expected) {
    if (std::find(counts.begin(), counts.end(), table.columns.size()) == counts.end())
        throw InputError(table.file + ": " + std::to_string(table.columns.size()) +
                         " columns are named; expected " + expected);
}

}  // namespace

ImportReport import_csv(const std::string& out_rawlog, const CsvImportOptions& options,
                        const std::function<void(double)>& progress) {
    Rig rig;
    load_calibrations(options.calibration_files, rig);
    ImportReport report;
    MeasurementSources sources;
    if (!options.gyro.file.empty()) {
        if (options.accel.file.empty()) {
            require_columns(options.gyro, {7}, "time, gyro x y z, accelerometer x y z");
        } else {
            require_columns(options.gyro, {4}, "time, gyro x y z");
            require_columns(options.accel, {4}, "time, accelerometer x y z");
        }
        sources.push_back(std::make_unique<CsvImuSource>(options));
    } else if (!options.accel.file.empty()) {
        throw InputError(options.accel.file + ": an accelerometer needs a gyro beside it");
    }
    if (!options.images.file.empty()) {
        require_columns(options.images, {1, 2}, "time and file, or time alone");
        sources.push_back(
            image_file_source(read_images(options), options.bit_depth, report.remarks));
    }
    if (sources.empty()) throw InputError("neither images nor IMU readings are named");
    RawlogWriterOptions writer_options;
    writer_options.external_images = options.external_images;
    RawlogWriter writer(out_rawlog, rig, writer_options);
    merge_sources(std::move(sources), writer, report, progress);
    writer.finish();
    return report;
}

}  // namespace vio
