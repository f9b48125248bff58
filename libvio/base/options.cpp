#include "libvio/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string_view>

#include "libvio/base/ini_file.h"
#include "libvio/base/nearest.h"
#include "libvio/base/strings.h"

namespace vio {
namespace {

template <typename T>
std::string printed(T value) {
    char buffer[64];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
    return {buffer, end};
}

// Whole text must be the number: MRPT itself reads "12abc" as 12.
template <typename T>
T parsed(const std::string& raw, OptionSet::Range range) {
    const std::string text(trimmed(raw));
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || text.empty() ||
        !std::isfinite(static_cast<double>(value)))
        throw InputError("'" + text + "' is not " +
                         (std::is_integral_v<T> ? "an integer" : "a finite number"));
    if (value < range.min || value > range.max)
        throw InputError(text + " is outside its range " + printed(range.min) + " to " +
                         printed(range.max));
    return value;
}

std::string joined(const std::vector<std::string>& parts) {
    std::string all;
    for (const std::string& part : parts) all += (all.empty() ? "" : " | ") + part;
    return all;
}

std::string range_text(OptionSet::Range range) {
    if (std::isinf(range.min) && std::isinf(range.max)) return "";
    return printed(range.min) + " to " + printed(range.max);
}

}  // namespace

void OptionSet::add(Option option) {
    option.section = section_;
    options_.push_back(std::move(option));
}

void OptionSet::add(std::string name, double* value, std::string unit, Range range,
                    std::string help) {
    add({"", std::move(name), std::move(unit), range_text(range), std::move(help),
         [=](const std::string& text) { *value = parsed<double>(text, range); },
         [=] { return printed(*value); }});
}

void OptionSet::add(std::string name, int* value, std::string unit, Range range, std::string help) {
    add({"", std::move(name), std::move(unit), range_text(range), std::move(help),
         [=](const std::string& text) { *value = parsed<int>(text, range); },
         [=] { return printed(*value); }});
}

void OptionSet::add(std::string name, bool* value, std::string help) {
    add({"", std::move(name), "", "true | false", std::move(help),
         [=](const std::string& raw) {
             const std::string text(trimmed(raw));
             if (text == "true" || text == "1" || text == "yes")
                 *value = true;
             else if (text == "false" || text == "0" || text == "no")
                 *value = false;
             else
                 throw InputError("'" + text + "' is neither true nor false");
         },
         [=] { return std::string(*value ? "true" : "false"); }});
}

void OptionSet::add(std::string name, std::string* value, std::string help) {
    add({"", std::move(name), "", "", std::move(help),
         [=](const std::string& text) { *value = std::string(trimmed(text)); },
         [=] { return *value; }});
}

void OptionSet::add(std::string name, std::string* value, std::vector<std::string> choices,
                    std::string help) {
    const std::string all = joined(choices);
    add({"", std::move(name), "", all, std::move(help),
         [=, choices = std::move(choices)](const std::string& raw) {
             const std::string text(trimmed(raw));
             if (std::find(choices.begin(), choices.end(), text) == choices.end())
                 throw InputError("'" + text + "' is none of " + all);
             *value = text;
         },
         [=] { return *value; }});
}

OptionSet::Option* OptionSet::find(const std::string& section, const std::string& name) {
    for (Option& option : options_)
        if (option.section == section && option.name == name) return &option;
    return nullptr;
}

void OptionSet::assign(const std::string& where, const std::string& section,
                       const std::string& name, const std::string& text) {
    Option* option = find(section, name);
    if (!option) {
        std::vector<std::string> names;
        for (const Option& known : options_) names.push_back(known.section + "." + known.name);
        const std::string meant = nearest(section + "." + name, names);
        throw InputError(where + " [" + section + "] " + name + ": no such option; " +
                         (meant.empty() ? "" : "did you mean " + meant + "? ") +
                         "`vio-slam run --print-options` lists them");
    }
    try {
        option->parse(text);
    } catch (const InputError& reason) {
        throw InputError(where + " [" + section + "] " + name + ": " + reason.what() +
                         (option->unit.empty() ? "" : " (unit: " + option->unit + ")"));
    }
}

void OptionSet::load(const std::string& ini_file) {
    const auto opened = open_ini(ini_file);
    const auto& ini = *opened;
    std::vector<std::string> sections;
    ini.getAllSections(sections);
    bool any = false;
    for (const std::string& section : sections) {
        const bool ours = std::any_of(options_.begin(), options_.end(),
                                      [&](const Option& o) { return o.section == section; });
        // The section of MRPT's own programs is read elsewhere.
        any = any || ours || section == "MappingApplication";
        if (!ours) continue;
        std::vector<std::string> keys;
        ini.getAllKeys(section, keys);
        for (const std::string& key : keys)
            assign(ini_file, section, key,
                   std::string(without_comment(ini.read_string(section, key, ""))));
    }
    if (!any)
        throw InputError(ini_file + ": none of its sections is known here; expected [" +
                         options_.front().section + "] or others of the same kind");
}

void OptionSet::set(const std::string& assignment) {
    const auto equals = assignment.find('=');
    const auto dot = assignment.find('.');
    if (equals == std::string::npos || dot == std::string::npos || dot > equals)
        throw InputError("--set " + assignment + ": expected section.name=value");
    const std::string_view text = assignment;
    assign("--set", std::string(trimmed(text.substr(0, dot))),
           std::string(trimmed(text.substr(dot + 1, equals - dot - 1))),
           std::string(text.substr(equals + 1)));
}

std::string OptionSet::to_ini() const {
    std::ostringstream out;
    std::string section;
    for (const Option& option : options_) {
        if (option.section != section) {
            section = option.section;
            out << (out.tellp() > 0 ? "\n" : "") << "[" << section << "]\n";
        }
        out << "# " << option.help;
        if (!option.unit.empty()) out << " [" << option.unit << "]";
        if (!option.range.empty()) out << " (" << option.range << ")";
        out << "\n" << option.name << " = " << option.print() << "\n";
    }
    return out.str();
}

void OptionSet::save(const std::string& ini_file) const {
    std::ofstream out(ini_file);
    out << to_ini();
    if (!out.flush()) throw InputError(ini_file + ": cannot be written; check folder and space");
}

}  // namespace vio
