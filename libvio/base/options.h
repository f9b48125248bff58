// Options, declared once: name, default, unit, range and help come from one line each.
//
// An option struct lists its members in describe(OptionSet&). From that list come the values in an
// MRPT INI file (read, checked and written), command-line overrides `--set section.name=value` and
// the help text.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "libvio/base/errors.h"

namespace vio {

/// Options by section and name, bound to the variables that hold them.
class OptionSet {
 public:
    /// Smallest and largest value allowed, both included, in the option's unit.
    struct Range {
        double min = -std::numeric_limits<double>::infinity();
        double max = std::numeric_limits<double>::infinity();
    };

    /// Options declared from here on belong to this INI section.
    void section(std::string name) { section_ = std::move(name); }

    void add(std::string name, double* value, std::string unit, Range range, std::string help);
    void add(std::string name, int* value, std::string unit, Range range, std::string help);
    void add(std::string name, bool* value, std::string help);
    void add(std::string name, std::string* value, std::string help);
    /// Text that must be one of the choices.
    void add(std::string name, std::string* value, std::vector<std::string> choices,
             std::string help);

    /// Reads every option that the file names. Throws InputError (one line: file, section, key) for
    /// a missing file, a file without any of our sections, an unknown key in one of them, or a
    /// value that does not parse or lies outside its range. Other sections are left alone.
    void load(const std::string& ini_file);

    /// Sets one option from "section.name=value"; throws InputError as load() does.
    void set(const std::string& assignment);

    /// All options with units, ranges and help as comments, in INI form; load() reads it back.
    std::string to_ini() const;
    void save(const std::string& ini_file) const;

 private:
    // A declared option as text: how its variable is set and printed.
    struct Option {
        std::string section, name, unit, range, help;
        std::function<void(const std::string& text)> parse;  // throws InputError: the reason only
        std::function<std::string()> print;
    };

    void add(Option option);
    Option* find(const std::string& section, const std::string& name);
    void assign(const std::string& where, const std::string& section, const std::string& name,
                const std::string& text);

    std::string section_;
    std::vector<Option> options_;
};

}  // namespace vio
