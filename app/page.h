// A page of text, tables and plots, as self-contained HTML and as Markdown.
#pragma once

#include <string>
#include <vector>

namespace vio::app {

/// A table of text: header and rows have the same number of cells.
struct Table {
    std::vector<std::string> header;
    std::vector<std::vector<std::string>> rows;
    std::string caption;
};

/// As Markdown, columns padded so that it also reads well on a terminal.
std::string to_markdown(const Table& table);

/// A page that grows part by part, in the order of the calls.
class Page {
 public:
    explicit Page(const std::string& title);

    void heading(const std::string& text);
    void text(const std::string& text);
    void table(const Table& table);
    /// Nothing without items.
    void list(const std::string& head, const std::vector<std::string>& items);
    /// A table whose first column and figures are to be looked up rather than read: folded away.
    void folded(const std::string& summary, const std::string& preformatted);
    /// Plots side by side as far as the page is wide. `name`: of their files beside the Markdown.
    void plots(const std::string& name, const std::vector<std::string>& svgs,
               const std::string& caption = "");
    /// A PNG file, put into the page.
    void picture(const std::string& png_file, const std::string& caption);

    /// No reference leads out of it.
    std::string html() const;
    /// Writes STEM.html, and if asked for STEM.md with the plots as STEM_files/*.svg.
    void write(const std::string& stem, bool with_markdown) const;

 private:
    // A plot beside the Markdown page: name below its folder, SVG text.
    struct File {
        std::string name, content;
    };
    std::string title_, html_, markdown_;
    std::vector<File> files_;
};

}  // namespace vio::app
