#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mvstudio::report {

/// Escapes text for HTML and XML content and quoted attributes. Bytes that are not UTF-8 and control characters become
/// U+FFFD.
std::string EscapeHtml(std::string_view text);

/// A page of this module with every text that people read changed by `map`; tags, styles, scripts and embedded files stay.
using TextMap = std::function<std::string(const std::string&)>;
std::string MapTexts(std::string_view html, const TextMap& map);

/// Outcome of a stage or a check. Never shown by colour alone: each has a word and a symbol.
enum class Verdict { kPass, kWarn, kFail, kNotRun };
std::string_view ToString(Verdict verdict);  ///< "pass", "warn", "fail", "not run"
/// The worse of two; kNotRun is the least.
Verdict Worse(Verdict a, Verdict b);

/// Arguments are plain text and are escaped here, except those whose names end in `_html`.
std::string BadgeHtml(Verdict verdict);
std::string ParagraphHtml(const std::string& text, const std::string& css_class = {});
std::string FigureHtml(const std::string& content_html, const std::string& caption);
std::string DetailsHtml(const std::string& summary, const std::string& body_html);
/// Figures side by side where the page is wide enough. `css_class` is "grid" or "grid small".
std::string GridHtml(const std::vector<std::string>& figures_html, const std::string& css_class = "grid");

/// A table; numeric columns are right-aligned.
class Table {
 public:
  explicit Table(std::string caption) : caption_(std::move(caption)) {}
  /// The unit, if any, is shown in the header, not in the cells.
  void AddColumn(const std::string& title, const std::string& unit = {}, bool numeric = true);
  struct Cell {
    std::string text;
    bool strong = false;
    std::string html;  ///< used instead of `text` when set
    Cell(const char* text_) : text(text_) {}
    Cell(std::string text_, bool strong_ = false) : text(std::move(text_)), strong(strong_) {}
  };
  /// One cell per column. `highlight` emphasises the row.
  void AddRow(std::vector<Cell> cells, bool highlight = false);
  bool empty() const { return rows_.empty(); }
  std::string Html() const;

 private:
  struct Column {
    std::string title, unit;
    bool numeric;
  };
  struct Row {
    std::vector<Cell> cells;
    bool highlight;
  };
  std::string caption_;
  std::vector<Column> columns_;
  std::vector<Row> rows_;
};

struct Section {
  std::string id, title;
  std::string body_html;
  bool has_results = true;  ///< false: the body says that nothing was run
};

/// The whole document; its title is the heading without `header_html`. No external links, no script but the given one, and a
/// content policy that forbids all others.
std::string PageHtml(const std::string& title, const std::string& header_html, const std::vector<Section>& sections,
                     const std::string& footer, std::string_view script = {});

/// The source expression of a content policy that allows this script and no other.
std::string ScriptSource(std::string_view script);

/// Style sheet of the page and of the figures' classes (light, dark and print).
std::string_view PageStyle();

}  // namespace mvstudio::report
