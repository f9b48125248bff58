#include "app/manual.h"

#include <vector>

namespace vio::app {
namespace {

using AppPointer = const CLI::App*;
using OptionPointer = const CLI::Option*;

std::vector<AppPointer> commands_of(const CLI::App& app) {
    return app.get_subcommands([](AppPointer command) { return !command->get_name().empty(); });
}

std::vector<OptionPointer> options_of(const CLI::App& app) {
    return app.get_options([](OptionPointer option) { return !option->get_group().empty(); });
}

// Text as troff prints it.
std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        if (c == '\\')
            out += "\\e";
        else if (c == '-')
            out += "\\-";
        else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
            out += std::string("\\&") + c;
        else
            out += c;
    }
    return out;
}

std::string capitals(std::string text) {
    for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
}

bool takes_value(const CLI::Option& option) {
    return option.get_expected_max() > 0;
}

std::string names(const CLI::Option& option) {
    std::string text;
    for (const std::string& name : option.get_snames())
        text += (text.empty() ? "" : ", ") + ("\\fB\\-" + escaped(name) + "\\fR");
    for (const std::string& name : option.get_lnames())
        text += (text.empty() ? "" : ", ") + ("\\fB\\-\\-" + escaped(name) + "\\fR");
    return text.empty() ? "\\fI" + escaped(option.get_name(true)) + "\\fR" : text;
}

void append_option(std::string& page, const CLI::Option& option) {
    page += ".TP\n" + names(option);
    if (takes_value(option) && !option.get_positional())
        page += " \\fI" + escaped(option.get_type_name()) + "\\fR";
    page += "\n";
    std::string text = option.get_description();
    if (option.get_required()) text += " (required)";
    if (!option.get_default_str().empty()) text += " [" + option.get_default_str() + "]";
    page += escaped(text) + "\n";
}

std::string synopsis(const CLI::App& app) {
    std::string text = ".B " + escaped(full_name(app)) + "\n";
    std::string arguments;
    for (const OptionPointer option : options_of(app)) {
        const std::string name = "\\fI" + escaped(option->get_name(true)) + "\\fR";
        if (option->get_positional())
            arguments +=
                (arguments.empty() ? "" : " ") + (option->get_required() ? name : "[" + name + "]");
        else if (option->get_required())
            arguments += (arguments.empty() ? "" : " ") + names(*option) + " \\fI" +
                         escaped(option->get_type_name()) + "\\fR";
    }
    return text + arguments + (arguments.empty() ? "" : "\n") + "[options]\n";
}

// A command with its options, and the commands below it.
void append_command(std::string& page, const CLI::App& command) {
    page +=
        ".SS " + escaped(full_name(command)) + "\n" + escaped(command.get_description()) + ".\n";
    const auto below = commands_of(command);
    if (below.empty()) page += ".PP\n" + synopsis(command);
    for (const OptionPointer option : options_of(command)) append_option(page, *option);
    for (const AppPointer sub : below) append_command(page, *sub);
}

// Choices that "TEXT:{a,b}" names, separated by blanks; empty where any value may be given.
std::string choices(const CLI::Option& option) {
    const std::string type = option.get_type_name();
    const auto open = type.find('{'), close = type.find('}');
    if (open == std::string::npos || close == std::string::npos) return {};
    std::string words = type.substr(open + 1, close - open - 1);
    for (char& c : words)
        if (c == ',') c = ' ';
    return words;
}

std::string words_of(const CLI::App& app) {
    std::string words;
    const auto add = [&](const std::string& word) { words += (words.empty() ? "" : " ") + word; };
    for (const AppPointer command : commands_of(app)) add(command->get_name());
    for (const OptionPointer option : options_of(app)) {
        for (const std::string& name : option->get_lnames()) add("--" + name);
        for (const std::string& name : option->get_snames()) add("-" + name);
    }
    return words;
}

// Cases of the script's two selections, for a command and those below it: words of a command by its
// path, and values by path and option.
void append_cases(const CLI::App& app, const std::string& path, std::string& words,
                  std::string& values) {
    words += "        '" + path + "') words='" + words_of(app) + "' ;;\n";
    for (const OptionPointer option : options_of(app)) {
        if (option->get_positional() || !takes_value(*option)) continue;
        std::string patterns;
        const auto add = [&](const std::string& name) {
            patterns += (patterns.empty() ? "'" : "|'") + path + " " + name + "'";
        };
        for (const std::string& name : option->get_lnames()) add("--" + name);
        for (const std::string& name : option->get_snames()) add("-" + name);
        const std::string choice = choices(*option);
        values += "        " + patterns + ") " +
                  (choice.empty() ? "compopt -o default" : "choice='" + choice + "'") +
                  "; return_values=1 ;;\n";
    }
    for (const AppPointer command : commands_of(app))
        append_cases(*command, path + "/" + command->get_name(), words, values);
}

std::string command_names(const CLI::App& app) {
    std::string all;
    for (const AppPointer command : commands_of(app)) {
        if (!all.empty()) all += " ";
        all += command->get_name();
        const std::string below = command_names(*command);
        if (!below.empty()) all += " " + below;
    }
    return all;
}

}  // namespace

std::string full_name(const CLI::App& app) {
    const CLI::App* parent = app.get_parent();
    return parent ? full_name(*parent) + " " + app.get_name() : app.get_name();
}

std::string manual_page(const CLI::App& program, const std::string& version,
                        const std::string& date) {
    const std::string& name = program.get_name();
    std::string page = ".TH " + capitals(escaped(name)) + " 1 \"" + date + "\" \"" + name + " " +
                       version + "\" \"User Commands\"\n.SH NAME\n" + escaped(name) +
                       " \\- motion, structure and gravity from a camera and an IMU\n" +
                       ".SH SYNOPSIS\n.B " + escaped(name) +
                       "\n.I COMMAND\n[options]\n.SH DESCRIPTION\n" +
                       escaped(program.get_description()) +
                       "\nExit status: 0 done, 1 bad input or failed estimate, 2 wrong use of the "
                       "command line.\n.SH OPTIONS\n";
    for (const OptionPointer option : options_of(program)) append_option(page, *option);
    page += ".SH COMMANDS\n";
    for (const AppPointer command : commands_of(program)) append_command(page, *command);
    return page +
           ".SH FILES\nFormats of rawlogs, calibrations and results:\n"
           ".I /usr/share/vio\\-slam/formats.md\n.br\nFrom a recording to a trajectory:\n"
           ".I /usr/share/vio\\-slam/TUTORIAL.md\n"
           ".SH SEE ALSO\n.BR rawlog\\-edit (1),\n.BR RawLogViewer (1),\n.BR SceneViewer3D (1),\n"
           ".BR rosbag2rawlog (1)\n";
}

std::string bash_completion(const CLI::App& program) {
    std::string words, values;
    append_cases(program, "", words, values);
    // The path of commands given so far decides; options may stand between them.
    return "# bash completion for " + program.get_name() +
           " (made from its own options)\n"
           "_vio_slam() {\n"
           "    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}\n"
           "    local path='' words='' choice='' return_values='' known word i\n"
           "    known=' " +
           command_names(program) +
           " '\n"
           "    for ((i = 1; i < COMP_CWORD; i++)); do\n"
           "        word=${COMP_WORDS[i]}\n"
           "        [[ $word != */* && $known == *\" $word \"* ]] || continue\n"
           "        _vio_slam_has \"$path\" \"$word\" && path=$path/$word\n"
           "    done\n"
           "    case \"$path $previous\" in\n" +
           values +
           "    esac\n"
           "    if [[ $return_values ]]; then\n"
           "        COMPREPLY=($(compgen -W \"$choice\" -- \"$current\"))\n"
           "        return\n"
           "    fi\n"
           "    words=$(_vio_slam_words \"$path\")\n"
           "    COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
           "    [[ $current == -* ]] || compopt -o default 2>/dev/null\n"
           "}\n"
           "_vio_slam_words() {\n"
           "    local words=''\n"
           "    case $1 in\n" +
           words +
           "    esac\n"
           "    printf '%s' \"$words\"\n"
           "}\n"
           "_vio_slam_has() {\n"
           "    [[ \" $(_vio_slam_words \"$1\") \" == *\" $2 \"* ]]\n"
           "}\n"
           "complete -F _vio_slam " +
           program.get_name() + "\n";
}

}  // namespace vio::app
