#include "app/usage.h"

#include "app/manual.h"
#include "libvio/base/nearest.h"

namespace vio::app {
namespace {

std::vector<std::string> command_names(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands([](auto*) { return true; }))
        names.push_back(command->get_name());
    return names;
}

std::vector<std::string> option_names(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::Option* option : app.get_options())
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    return names;
}

std::string joined(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
    return all;
}

// Of a word that means nothing to the command.
std::string unknown(const CLI::App& command, const std::string& word) {
    if (word.starts_with("-")) {
        const std::string name = word.substr(0, word.find('='));
        const std::string meant = nearest(name, option_names(command));
        return name + ": no such option" + (meant.empty() ? "" : "; did you mean " + meant + "?");
    }
    const auto names = command_names(command);
    if (names.empty()) return word + ": one argument too many";
    const std::string meant = nearest(word, names);
    return word + ": no such command; " +
           (meant.empty() ? "there are " + joined(names) : "did you mean " + meant + "?");
}

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_formatter() {
    class Formatter : public CLI::Formatter {
        std::string make_option_usage(const CLI::Option* option) const override {
            const std::string name =
                option->get_name() + (option->get_expected_max() > 1 ? "..." : "");
            return option->get_required() ? name : "[" + name + "]";
        }
    };
    return std::make_shared<Formatter>();
}

std::string usage_error(const CLI::App& program, const CLI::ParseError& error) {
    // The commands that were understood, outermost first.
    const CLI::App* command = &program;
    std::vector<std::string> words = command->remaining();
    while (words.empty() && !command->get_subcommands().empty()) {
        command = command->get_subcommands().back();
        words = command->remaining();
    }
    const std::string help = "; see " + full_name(*command) + " --help";
    const bool missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
    const bool names_command =
        missing && command->get_subcommands().empty() && command->get_require_subcommand_min() > 0;
    if (!words.empty() && (names_command || dynamic_cast<const CLI::ExtrasError*>(&error)))
        return unknown(*command, words.front()) + help;
    if (names_command)
        return full_name(*command) + ": name one of " + joined(command_names(*command)) + help;
    return error.what() + help;
}

}  // namespace vio::app
