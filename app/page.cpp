#include "app/page.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "app/plot.h"
#include "libvio/base/errors.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCss =
    "body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif}"
    "main{max-width:1120px;margin:0 auto;padding:24px 20px 60px}"
    "h1{font-size:26px;margin:8px 0 4px;overflow-wrap:anywhere}h2{font-size:18px;margin:34px 0 "
    "8px;padding-top:10px;"
    "border-top:1px solid var(--rule)}h3{font-size:14px;margin:12px 0 2px}ul{margin:4px 0 12px;"
    "padding-left:20px}li{margin:4px "
    "0;color:var(--faint);font-size:13.5px;max-width:110ch}p{margin:6px 0 "
    "12px;color:var(--faint);max-width:80ch}"
    ".scroll{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;"
    "font-size:13.5px;margin:8px 0 14px}th,td{padding:4px 11px;text-align:right;"
    "border-bottom:1px solid var(--rule);white-space:nowrap}th{font-weight:600;white-space:normal;"
    "vertical-align:bottom;"
    "background:var(--shade)}th:first-child,td:first-child,.t,.w{text-align:left}"
    "td.w{white-space:normal;min-width:14em;max-width:70ch}"
    "tr:hover td{background:var(--shade)}figure{margin:10px 0 18px}"
    ".plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(440px,100%),1fr));"
    "gap:14px}"
    ".plots svg{width:100%;height:auto;background:var(--paper)}"
    "figcaption{color:var(--faint);font-size:13px}img{max-width:100%;border-radius:6px}"
    "details{margin:10px 0}summary{cursor:pointer;font-weight:600}"
    "pre{background:var(--shade);padding:12px;overflow-x:auto;font-size:12.5px;border-radius:6px}"
    "@media(max-width:520px){main{padding:14px 12px 40px}h1{font-size:21px}}"
    // The picture is drawn on white: its lightness is turned over, its hues stay.
    "@media(prefers-color-scheme:dark){img{filter:invert(.9) hue-rotate(180deg)}}";

std::string escaped(const std::string& text) {
    std::string result;
    for (const char c : text) {
        if (c == '&')
            result += "&amp;";
        else if (c == '<')
            result += "&lt;";
        else if (c == '>')
            result += "&gt;";
        else
            result += c;
    }
    return result;
}

// Figures are set to the right, words to the left (class t); long texts are broken (class w).
std::string column_class(const std::vector<std::vector<std::string>>& rows, size_t column) {
    constexpr size_t kLong = 40;
    std::string name;
    for (const auto& row : rows) {
        if (column >= row.size()) continue;
        const std::string& cell = row[column];
        if (cell.size() > kLong) return "w";
        const auto letters = std::count_if(cell.begin(), cell.end(),
                                           [](unsigned char c) { return std::isalpha(c); });
        if (letters > 3) name = "t";
    }
    return name;
}

// Columns that a text takes on a terminal: UTF-8's continuation bytes take none.
size_t width(const std::string& text) {
    return static_cast<size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string base64(const std::string& bytes) {
    constexpr const char* kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        unsigned value = 0;
        for (size_t k = 0; k < 3; ++k)
            value =
                value << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (size_t k = 0; k < 4; ++k)
            text += i + k > bytes.size() ? '=' : kDigits[value >> (18 - 6 * k) & 63];
    }
    return text;
}

}  // namespace

std::string to_markdown(const Table& table) {
    std::vector<size_t> widths;
    for (const std::string& cell : table.header) widths.push_back(std::max<size_t>(3, width(cell)));
    for (const auto& row : table.rows)
        for (size_t c = 0; c < row.size() && c < widths.size(); ++c)
            widths[c] = std::max(widths[c], width(row[c]));
    std::string text;
    const auto add = [&](const std::vector<std::string>& row) {
        for (size_t c = 0; c < widths.size(); ++c) {
            const std::string cell = c < row.size() ? row[c] : "";
            const std::string space(widths[c] - width(cell), ' ');
            text += "| " + (c == 0 ? cell + space : space + cell) + " ";
        }
        text += "|\n";
    };
    add(table.header);
    for (size_t c = 0; c < widths.size(); ++c)
        text += "|" + std::string(widths[c] + 1, '-') + (c == 0 ? "-" : ":");
    text += "|\n";
    for (const auto& row : table.rows) add(row);
    return text;
}

Page::Page(const std::string& title) : title_(title) {
    html_ = "<h1>" + escaped(title) + "</h1>\n";
    markdown_ = "# " + title + "\n\n";
}

void Page::heading(const std::string& text) {
    html_ += "<h2>" + escaped(text) + "</h2>\n";
    markdown_ += "## " + text + "\n\n";
}

void Page::text(const std::string& text) {
    html_ += "<p>" + escaped(text) + "</p>\n";
    markdown_ += text + "\n\n";
}

void Page::table(const Table& table) {
    std::vector<std::string> classes;
    for (size_t c = 0; c < table.header.size(); ++c) classes.push_back(column_class(table.rows, c));
    const auto cells = [&](const std::vector<std::string>& row, const std::string& tag) {
        for (size_t c = 0; c < row.size(); ++c) {
            const bool plain = c >= classes.size() || classes[c].empty();
            html_ += "<" + tag + (plain ? "" : " class=\"" + classes[c] + "\"") + ">" +
                     escaped(row[c]) + "</" + tag + ">";
        }
    };
    html_ += "<div class=\"scroll\"><table><thead><tr>";
    cells(table.header, "th");
    html_ += "</tr></thead><tbody>\n";
    for (const auto& row : table.rows) {
        html_ += "<tr>";
        cells(row, "td");
        html_ += "</tr>\n";
    }
    html_ += "</tbody></table></div>\n";
    markdown_ += to_markdown(table) + "\n";
    if (!table.caption.empty()) text(table.caption);
}

void Page::list(const std::string& head, const std::vector<std::string>& items) {
    if (items.empty()) return;
    html_ += "<h3>" + escaped(head) + "</h3>\n<ul>\n";
    markdown_ += head + ":\n\n";
    for (const std::string& item : items) {
        html_ += "<li>" + escaped(item) + "</li>\n";
        markdown_ += "- " + item + "\n";
    }
    html_ += "</ul>\n";
    markdown_ += "\n";
}

void Page::folded(const std::string& summary, const std::string& preformatted) {
    html_ += "<details><summary>" + escaped(summary) + "</summary><pre>" + escaped(preformatted) +
             "</pre></details>\n";
    markdown_ += "<details><summary>" + summary + "</summary>\n\n```\n" + preformatted +
                 "\n```\n\n</details>\n\n";
}

void Page::plots(const std::string& name, const std::vector<std::string>& svgs,
                 const std::string& caption) {
    html_ += "<figure><div class=\"plots\">\n";
    for (size_t i = 0; i < svgs.size(); ++i) {
        html_ += svgs[i] + "\n";
        const std::string file =
            name + (svgs.size() > 1 ? "_" + std::to_string(i + 1) : "") + ".svg";
        files_.push_back({file, standalone(svgs[i])});
        markdown_ += "![" + name + "](FILES/" + file + ")\n";
    }
    html_ += "</div>";
    if (!caption.empty()) html_ += "<figcaption>" + escaped(caption) + "</figcaption>";
    html_ += "</figure>\n";
    markdown_ += "\n" + (caption.empty() ? "" : caption + "\n\n");
}

void Page::picture(const std::string& png_file, const std::string& caption) {
    html_ += "<figure><img alt=\"" + escaped(caption) + "\" src=\"data:image/png;base64," +
             base64(read_text(png_file)) + "\"><figcaption>" + escaped(caption) +
             "</figcaption></figure>\n";
}

std::string Page::html() const {
    return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
           "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>" +
           escaped(title_) + "</title><style>" + theme_css() + kCss +
           "</style></head><body><main>" + html_ + "</main></body></html>\n";
}

void Page::write(const std::string& stem, bool with_markdown) const {
    write_text(stem + ".html", html());
    if (!with_markdown) return;
    const std::string folder = stem + "_files";
    fs::create_directories(folder);
    for (const File& file : files_) write_text(folder + "/" + file.name, file.content);
    std::string text = markdown_;
    const std::string here = fs::path(folder).filename().string();
    for (size_t at = 0; (at = text.find("](FILES/", at)) != std::string::npos;)
        text.replace(at + 2, 5, here);
    write_text(stem + ".md", text);
}

}  // namespace vio::app
