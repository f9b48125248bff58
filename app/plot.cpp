#include "app/plot.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>

#include "app/process.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;

// gnuplot knows no CSS: it draws in colours that stand for the page's, which are put in after.
constexpr int kFirstColour = 240, kInk = 248, kRule = 249;
// More points than pixels are not seen, but make pages heavy.
constexpr size_t kMaxPoints = 1500;

std::string colour(int number) {
    char text[16];
    std::snprintf(text, sizeof(text), "'#0000%02x'", number);
    return text;
}

std::string quoted(const std::string& text) {
    std::string result = "'";
    for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c);
    return result + "'";
}

void write_data(std::ostream& script, const std::string& name, const Series& s) {
    script << "$" << name << " << EOD\n";
    const size_t step = s.style == Series::kPoints ? 1 : s.x.size() / kMaxPoints + 1;
    bool gap = true;
    for (size_t i = 0; i < s.x.size(); ++i) {
        if (i % step != 0 && i + 1 != s.x.size()) continue;
        const bool finite = std::isfinite(s.x[i]) && std::isfinite(s.y[i]);
        if (finite) {
            script << format(s.x[i]) << ' ' << format(s.y[i]);
            if (s.style == Series::kBand) script << ' ' << format(s.y2[i]);
            script << '\n';
        } else if (!gap) {
            script << '\n';
        }
        gap = !finite;
    }
    script << "EOD\n";
}

std::string curve(const std::string& data, const Series& s) {
    const std::string c = colour(kFirstColour + s.colour);
    std::string text = "$" + data + " using 1:2";
    switch (s.style) {
        case Series::kLine:
            text += " with lines lw 1.8 lc rgb " + c;
            break;
        case Series::kDashed:
            text += " with lines lw 1.4 dt (7,5) lc rgb " + c;
            break;
        case Series::kPoints:
            text += " with points pt 7 ps 0.35 lc rgb " + c;
            break;
        case Series::kSquares:
            text += " with points pt 4 ps 1 lw 1.5 lc rgb " + c;
            break;
        case Series::kLinePoints:
            text += " with linespoints lw 1.8 pt 7 ps 0.5 lc rgb " + c;
            break;
        case Series::kBand:
            text += ":3 with filledcurves fs transparent solid 0.18 noborder fc rgb " + c;
            break;
    }
    return text + (s.name.empty() ? " notitle" : " title " + quoted(s.name));
}

void write_plot(std::ostream& script, const Plot& plot, const std::string& file) {
    std::string curves;
    int count = 0;
    for (const Series& s : plot.series) {
        if (s.x.empty()) continue;
        const std::string data = "d" + std::to_string(count++);
        write_data(script, data, s);
        curves += (curves.empty() ? "" : ", ") + curve(data, s);
    }
    script << "set terminal svg size " << plot.width << "," << plot.height
           << " dynamic font 'sans-serif,12' noenhanced\nset output " << quoted(file) << "\n"
           << "set autoscale xfix\nset border 3 lc rgb " << colour(kRule)
           << "\nset tics nomirror out scale 0.5 tc rgb " << colour(kInk) << "\nset grid lc rgb "
           << colour(kRule) << " lt 1 lw 0.4\n"
           << "set key above left horizontal Left reverse samplen 2 tc rgb " << colour(kInk)
           << "\nset xlabel " << quoted(plot.x_label) << " tc rgb " << colour(kInk)
           << "\nset ylabel " << quoted(plot.y_label) << " tc rgb " << colour(kInk) << "\n"
           << (plot.title.empty() ? "unset title"
                                  : "set title " + quoted(plot.title) + " tc rgb " + colour(kInk))
           << "\n"
           << (plot.equal_axes ? "set size ratio -1\n" : "set size noratio\n")
           << (plot.log_x ? "set logscale x\nset format x '10^{%T}'\n"
                          : "unset logscale x\nset format x '% h'\n")
           << (plot.log_y ? "set logscale y\n" : "unset logscale y\n")
           << (plot.whole_x ? "set xtics 1\n" : "set xtics autofreq\n");
    script << (curves.empty() ? "plot [0:1][0:1] NaN notitle\n" : "plot " + curves + "\n");
    script << "set output\n";
}

std::string themed(const std::string& svg) {
    std::string text = svg.substr(svg.find("<svg"));
    static const std::regex titles("<title>[^<]*</title>\\s*<desc>[^<]*</desc>");
    text = std::regex_replace(text, titles, "");
    static const std::regex code("rgb\\( *0, *0, *(24[0-9])\\)");
    std::string result;
    auto last = text.cbegin();
    for (std::sregex_iterator it(text.begin(), text.end(), code), end; it != end; ++it) {
        result.append(last, (*it)[0].first);
        const int number = std::stoi((*it)[1]);
        result += number == kInk    ? "var(--ink)"
                  : number == kRule ? "var(--rule)"
                                    : "var(--c" + std::to_string(number - kFirstColour) + ")";
        last = (*it)[0].second;
    }
    result.append(last, text.cend());
    return std::regex_replace(result, std::regex("color=\"black\""), "color=\"var(--ink)\"");
}

// Folder that vanishes with the object.
struct TemporaryFolder {
    fs::path path = fs::temp_directory_path() / ("vio_plots_" + std::to_string(::getpid()));
    TemporaryFolder() { fs::create_directories(path); }
    ~TemporaryFolder() {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
};

}  // namespace

std::vector<std::string> draw(const std::vector<Plot>& plots) {
    const TemporaryFolder folder;
    const auto file = [&](size_t i) {
        return (folder.path / (std::to_string(i) + ".svg")).string();
    };
    std::ostringstream script;
    for (size_t i = 0; i < plots.size(); ++i) write_plot(script, plots[i], file(i));
    const std::string script_file = (folder.path / "plots.gp").string();
    std::ofstream(script_file) << script.str();
    const std::string log = (folder.path / "log").string();
    int code = 0;
    try {
        code = run_process({"gnuplot", script_file}, log);
    } catch (const InputError& error) {
        throw InputError(std::string(error.what()) +
                         "; plots are drawn by gnuplot: apt-get install gnuplot-nox");
    }
    std::vector<std::string> drawn;
    for (size_t i = 0; i < plots.size(); ++i) {
        if (code != 0 || !is_there(file(i)))
            throw InputError("gnuplot: has failed: " + one_line(read_text(log)));
        drawn.push_back(themed(read_text(file(i))));
    }
    return drawn;
}

std::string theme_css() {
    return ":root{color-scheme:light dark;--paper:#ffffff;--ink:#20262e;--faint:#5f6b78;"
           "--rule:#d5dbe1;--shade:#f4f6f8;--c1:#1167c9;--c2:#d9730d;--c3:#1b8a4b;--c4:#b3329a;"
           "--c5:#7a8794;--c6:#d1242f}\n"
           "@media(prefers-color-scheme:dark){:root{--paper:#15191e;--ink:#e4e8ed;--faint:#9aa6b2;"
           "--rule:#3a434d;--shade:#1e242b;--c1:#5aa9ff;--c2:#ffa24a;--c3:#4fd08a;--c4:#f07ad6;"
           "--c5:#98a5b3;--c6:#ff6b6b}}\n";
}

std::string standalone(const std::string& svg) {
    const size_t at = svg.find('>') + 1;
    return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n" + svg.substr(0, at) + "\n<style>" +
           theme_css() + "</style>" + svg.substr(at);
}

}  // namespace vio::app
