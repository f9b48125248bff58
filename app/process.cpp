#include "app/process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>

#include "libvio/base/errors.h"

namespace vio::app {
namespace {

// The environment, with one thread for OpenMP and OpenBLAS where it says nothing of them.
std::vector<std::string> environment(bool single_thread) {
    std::vector<std::string> variables;
    for (char** v = environ; *v; ++v) variables.emplace_back(*v);
    if (!single_thread) return variables;
    for (const char* name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"})
        if (!std::getenv(name)) variables.push_back(std::string(name) + "=1");
    return variables;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
    std::vector<char*> list;
    for (std::string& text : texts) list.push_back(text.data());
    list.push_back(nullptr);
    return list;
}

}  // namespace

std::string own_program() {
    return std::filesystem::read_symlink("/proc/self/exe").string();
}

pid_t start_process(const std::vector<std::string>& command, const std::string& log_file,
                    bool single_thread) {
    std::vector<std::string> arguments = command, variables = environment(single_thread);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log_file.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    pid_t process = -1;
    const int error = posix_spawnp(&process, command.front().c_str(), &actions, nullptr,
                                   pointers(arguments).data(), pointers(variables).data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
        throw InputError(command.front() + ": cannot be started: " + std::strerror(error));
    return process;
}

int wait_for(pid_t process) {
    int status = 0;
    while (waitpid(process, &status, 0) < 0)
        if (errno != EINTR) return -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::vector<std::string> split_arguments(const std::string& text) {
    std::vector<std::string> arguments;
    std::string argument;
    bool quoted = false, inside = false;
    for (const char c : text) {
        if (c == '"') {
            quoted = !quoted;
            inside = true;
        } else if (c == ' ' && !quoted) {
            if (inside) arguments.push_back(argument);
            argument.clear();
            inside = false;
        } else {
            argument += c;
            inside = true;
        }
    }
    if (inside) arguments.push_back(argument);
    return arguments;
}

std::string shell_text(const std::vector<std::string>& command) {
    std::string text;
    for (const std::string& argument : command) {
        const bool plain = argument.find_first_not_of(
                               "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQR"
                               "STUVWXYZ0123456789_-+=./:,@%") == std::string::npos;
        if (!text.empty()) text += ' ';
        if (plain && !argument.empty()) {
            text += argument;
            continue;
        }
        text += '\'';
        for (const char c : argument) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
        text += '\'';
    }
    return text;
}

}  // namespace vio::app
