// Numbers and rows of text files: exact, strict, and with the place of every error.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/base/strings.h"
#include "libvio/base/types.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/left_out.h"

namespace vio {

/// Whole text as a finite number; nothing otherwise.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_integer(std::string_view text);

/// Decimal seconds, with or without exponent, as nanoseconds: exact to nine decimals, rounded to
/// the nearest beyond. Nothing if the text is no such number or does not fit.
std::optional<TimeNs> parse_seconds(std::string_view text);

/// Shortest text that reads back to the same double.
std::string format(double value);
/// Seconds with nine decimals, exact.
std::string format_seconds(TimeNs t);

/// Numbers as format() gives them, with the separator between them.
template <typename Numbers>
std::string joined(const Numbers& numbers, const char* separator = ",") {
    std::string text;
    for (const double number : numbers) text += (text.empty() ? "" : separator) + format(number);
    return text;
}

std::string read_text(const std::string& file);

/// One line: message of an exception without line breaks.
std::string one_line(std::string_view text);

/// What to throw where a file cannot be written.
InputError cannot_write(const std::string& file);

/// Writes a file by calling write(temporary name) and renaming, so that it appears complete or not
/// at all. Throws InputError if that fails, and whatever write throws.
void write_complete(const std::string& file,
                    const std::function<void(const std::string& temporary)>& write);
/// The same, of a text.
void write_text(const std::string& file, const std::string& text);

/// Rows of a table in a text file, plain or gzip-compressed. Blank lines and lines that begin with
/// # or % are passed over.
class TextRows {
 public:
    /// Fields are separated by commas if the row has any, else by blanks. Throws InputError for a
    /// missing file.
    explicit TextRows(const std::string& file) : input_(file) {}

    /// Reads the next row; false at the end. Throws InputError where the file is damaged.
    bool next();

    size_t size() const { return fields_.size(); }
    bool comma_separated() const { return comma_separated_; }
    /// Throws InputError if the row has fewer than count fields.
    void require(size_t count) const;
    std::string_view text(size_t field) const { return fields_[field]; }
    /// Throws InputError if it is none, UnusableMeasurement if it is empty, infinite or not a
    /// number by name ("nan").
    double number(size_t field) const { return number(fields_[field]); }
    double number(std::string_view text) const;  ///< the same of a text in this row
    std::int64_t integer(size_t field) const;    ///< throws InputError if it is none
    TimeNs seconds(size_t field) const;          ///< throws InputError if it is none

    /// "FILE (line N)".
    std::string place() const { return file() + " (line " + std::to_string(line_number_) + ")"; }
    /// "FILE (line N): problem".
    InputError error(const std::string& problem) const {
        return InputError(place() + ": " + problem);
    }
    double progress() const { return input_.progress(); }
    const std::string& file() const { return input_.file(); }

 private:
    void split();

    GzInput input_;
    std::string line_;
    std::vector<std::string_view> fields_;  ///< into line_
    bool comma_separated_ = false;
    int line_number_ = 0;
};

}  // namespace vio
