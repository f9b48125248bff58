#include "libvio/io/text.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "libvio/base/files.h"

namespace vio {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

template <typename T>
std::optional<T> parsed(std::string_view text) {
    text = trimmed(text);
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) return {};
    return value;
}

bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

}  // namespace

std::optional<double> parse_double(std::string_view text) {
    const auto value = parsed<double>(text);
    if (value && !std::isfinite(*value)) return {};
    return value;
}

std::optional<std::int64_t> parse_integer(std::string_view text) {
    return parsed<std::int64_t>(text);
}

std::optional<TimeNs> parse_seconds(std::string_view text) {
    text = trimmed(text);
    const bool negative = !text.empty() && text[0] == '-';
    if (!text.empty() && (text[0] == '-' || text[0] == '+')) text.remove_prefix(1);

    std::int64_t exponent = 0;
    if (const auto e = text.find_first_of("eE"); e != std::string_view::npos) {
        const auto value = parse_integer(text.substr(e + 1));
        if (!value || std::abs(*value) > 1000) return {};
        exponent = *value;
        text = text.substr(0, e);
    }
    // Digits d0 d1 d2 ... stand for 0.d0d1d2... * 10^point.
    std::string digits;
    std::int64_t point = -1;
    for (const char c : text) {
        if (c == '.' && point < 0)
            point = static_cast<std::int64_t>(digits.size());
        else if (is_digit(c))
            digits += c;
        else
            return {};
    }
    if (digits.empty()) return {};
    if (point < 0) point = static_cast<std::int64_t>(digits.size());
    const std::int64_t places = point + exponent + 9;  // digits of the number in nanoseconds
    const auto leading = digits.find_first_not_of('0');
    if (leading == std::string::npos) return 0;
    if (places - static_cast<std::int64_t>(leading) > 19) return {};

    std::uint64_t t = 0;  // holds any 19 digits
    const auto count = static_cast<std::int64_t>(digits.size());
    for (std::int64_t i = static_cast<std::int64_t>(leading); i < places; ++i)
        t = 10 * t + static_cast<unsigned>(i < count ? digits[static_cast<size_t>(i)] - '0' : 0);
    if (places >= 0 && places < count && digits[static_cast<size_t>(places)] >= '5') ++t;
    if (t > static_cast<std::uint64_t>(std::numeric_limits<TimeNs>::max())) return {};
    return negative ? -static_cast<TimeNs>(t) : static_cast<TimeNs>(t);
}

std::string format(double value) {
    char buffer[64];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
    return {buffer, end};
}

InputError cannot_write(const std::string& file) {
    return InputError(file + ": cannot be written; check folder and space");
}

std::string format_seconds(TimeNs t) {
    const TimeNs magnitude = t < 0 ? -t : t;
    std::string fraction = std::to_string(magnitude % 1000000000);
    fraction.insert(0, 9 - fraction.size(), '0');
    std::string text(t < 0 ? "-" : "");
    return text.append(std::to_string(magnitude / 1000000000)).append(".").append(fraction);
}

std::string read_text(const std::string& file) {
    if (!is_file(file)) throw InputError(file + ": no such file; check the path");
    std::ifstream in(file, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    if (!in) throw InputError(file + ": cannot be read; check its permissions");
    return text.str();
}

std::string one_line(std::string_view text) {
    std::string line;
    for (const char c : trimmed(text)) {
        const bool blank = kBlanks.find(c) != std::string_view::npos;
        if (!blank)
            line += c;
        else if (line.back() != ' ')
            line += ' ';
    }
    return line;
}

void write_complete(const std::string& file,
                    const std::function<void(const std::string& temporary)>& write) {
    const std::string temporary = file + ".partial";
    std::error_code error;
    try {
        write(temporary);
    } catch (...) {
        std::filesystem::remove(temporary, error);
        throw;
    }
    std::filesystem::rename(temporary, file, error);
    if (error) throw InputError(file + ": cannot be written (" + error.message() + ")");
}

void write_text(const std::string& file, const std::string& text) {
    write_complete(file, [&](const std::string& temporary) {
        std::ofstream out(temporary, std::ios::binary);
        out << text;
        if (!out.flush()) throw cannot_write(file);
    });
}

bool TextRows::next() {
    try {
        while (input_.getline(line_)) {
            ++line_number_;
            const std::string_view content = trimmed(line_);
            if (content.empty() || content[0] == '#' || content[0] == '%') continue;
            split();
            return true;
        }
    } catch (const InputError&) {
        throw;
    } catch (const std::exception& reason) {
        throw error(reason.what());
    }
    return false;
}

void TextRows::split() {
    fields_.clear();
    std::string_view rest = trimmed(line_);
    comma_separated_ = rest.find(',') != std::string_view::npos;
    const std::string_view separators = comma_separated_ ? "," : kBlanks;
    while (true) {
        const auto end = rest.find_first_of(separators);
        fields_.push_back(trimmed(rest.substr(0, end)));
        if (end == std::string_view::npos) return;
        rest = rest.substr(end + 1);
        if (!comma_separated_) rest = trimmed(rest);
    }
}

void TextRows::require(size_t count) const {
    if (size() < count)
        throw error("a row must have " + std::to_string(count) + " fields, this one has " +
                    std::to_string(size()));
}

double TextRows::number(std::string_view text) const {
    if (const auto value = parse_double(text)) return *value;
    const std::string problem = "'" + std::string(text) + "' is not a finite number";
    if (trimmed(text).empty() || parsed<double>(text))
        throw UnusableMeasurement(place() + ": " + problem);
    throw error(problem);
}

std::int64_t TextRows::integer(size_t field) const {
    const auto value = parse_integer(fields_[field]);
    if (!value) throw error("'" + std::string(fields_[field]) + "' is not an integer");
    return *value;
}

TimeNs TextRows::seconds(size_t field) const {
    const auto value = parse_seconds(fields_[field]);
    if (!value)
        throw error("'" + std::string(fields_[field]) +
                    "' is not a time in seconds; divide nanoseconds by 10^9");
    return *value;
}

}  // namespace vio
