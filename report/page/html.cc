#include "report/page/html.h"

#include <algorithm>

#include "core/check.h"
#include "core/hash/sha256.h"
#include "core/utf8.h"
#include "report/page/image.h"

namespace mvstudio::report {
namespace {

constexpr char kReplacement[] = "\ufffd";

std::string Tag(const std::string& name, const std::string& css_class, const std::string& body_html) {
  return "<" + name + (css_class.empty() ? "" : " class=\"" + EscapeHtml(css_class) + "\"") + ">" + body_html + "</" + name +
         ">\n";
}

}  // namespace

std::string EscapeHtml(std::string_view text) {
  std::string out;
  out.reserve(text.size() + text.size() / 8);
  for (size_t i = 0; i < text.size();) {
    const char c = text[i];
    const size_t length = Utf8Length(text, i);
    const bool control = (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f;
    if (length == 0 || control) {
      out += kReplacement;
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else if (c == '\'') {
      out += "&#39;";
    } else {
      out += text.substr(i, length);
    }
    i += std::max<size_t>(length, 1);
  }
  return out;
}

std::string_view ToString(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kWarn:
      return "warn";
    case Verdict::kFail:
      return "fail";
    case Verdict::kNotRun:
      return "not run";
  }
  return "not run";
}

Verdict Worse(Verdict a, Verdict b) {
  const auto rank = [](Verdict v) { return v == Verdict::kNotRun ? -1 : static_cast<int>(v); };
  return rank(a) >= rank(b) ? a : b;
}

std::string BadgeHtml(Verdict verdict) {
  static constexpr const char* kSigns[] = {"\u2713", "!", "\u2717", "\u00b7"};
  static constexpr const char* kClasses[] = {"pass", "warn", "fail", "idle"};
  const int i = static_cast<int>(verdict);
  return std::string("<span class=\"badge ") + kClasses[i] + "\"><span aria-hidden=\"true\">" + kSigns[i] + "</span> " +
         std::string(ToString(verdict)) + "</span>";
}

std::string ParagraphHtml(const std::string& text, const std::string& css_class) {
  return Tag("p", css_class, EscapeHtml(text));
}

std::string FigureHtml(const std::string& content_html, const std::string& caption) {
  return "<figure>" + content_html + (caption.empty() ? "" : "<figcaption>" + EscapeHtml(caption) + "</figcaption>") +
         "</figure>\n";
}

std::string DetailsHtml(const std::string& summary, const std::string& body_html) {
  return "<details><summary>" + EscapeHtml(summary) + "</summary>\n" + body_html + "</details>\n";
}

std::string GridHtml(const std::vector<std::string>& figures_html, const std::string& css_class) {
  std::string body;
  for (const std::string& figure : figures_html) body += figure;
  return Tag("div", css_class, body);
}

void Table::AddColumn(const std::string& title, const std::string& unit, bool numeric) {
  columns_.push_back({title, unit, numeric});
}

void Table::AddRow(std::vector<Cell> cells, bool highlight) {
  MVS_CHECK(cells.size() == columns_.size(), cells.size()
                                                 << " cells for " << columns_.size() << " columns of '" << caption_ << "'");
  rows_.push_back({std::move(cells), highlight});
}

std::string Table::Html() const {
  // A wide table scrolls in its box, which the keyboard must reach.
  constexpr size_t kWide = 2, kLongText = 32;
  const std::string name = caption_.empty() ? "Table" : "Table: " + caption_;
  const std::string reached =
      columns_.size() <= kWide ? "" : " tabindex=\"0\" role=\"group\" aria-label=\"" + EscapeHtml(name) + "\"";
  std::string html = "<div class=\"scroll\"" + reached + "><table>";
  if (!caption_.empty()) html += "<caption>" + EscapeHtml(caption_) + "</caption>";
  html += "<thead><tr>";
  for (const Column& column : columns_) {
    if (column.title.empty() && column.unit.empty()) {
      html += "<td></td>";  // no header without text
      continue;
    }
    html += std::string("<th scope=\"col\"") + (column.numeric ? " class=\"num\">" : ">") + EscapeHtml(column.title);
    if (!column.unit.empty()) html += " <span class=\"unit\">" + EscapeHtml(column.unit) + "</span>";
    html += "</th>";
  }
  html += "</tr></thead>\n<tbody>";
  for (const Row& row : rows_) {
    html += row.highlight ? "<tr class=\"look\">" : "<tr>";
    for (size_t i = 0; i < columns_.size(); ++i) {
      const bool numeric = columns_[i].numeric;
      const Cell& cell = row.cells[i];
      const std::string text = cell.html.empty() ? EscapeHtml(cell.text) : cell.html;
      const bool is_long = cell.text.size() > kLongText;  // wraps
      html += std::string(!numeric  ? "<td>"
                          : is_long ? "<td class=\"num long\">"
                                    : "<td class=\"num\">") +
              (cell.strong ? "<strong>" + text + "</strong>" : text) + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string PageHtml(const std::string& title, const std::string& header_html, const std::vector<Section>& sections,
                     const std::string& footer, std::string_view script) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; media-src data:; style-src "
      "'unsafe-inline'" +
      (script.empty() ? "" : "; script-src " + ScriptSource(script)) +
      "\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n<title>" +
      EscapeHtml(title) + "</title>\n<style>\n" + std::string(PageStyle()) + "</style>\n</head>\n<body>\n<header>" +
      (header_html.empty() ? "<h1>" + EscapeHtml(title) + "</h1>\n" : header_html) + "</header>\n<nav aria-label=\"Sections\">";
  for (const Section& section : sections) {
    html += "<a href=\"#" + EscapeHtml(section.id) + "\">" + EscapeHtml(section.title) + "</a>";
  }
  html += "</nav>\n<main>\n";
  for (const Section& section : sections) {
    html += "<section id=\"" + EscapeHtml(section.id) + "\">\n<h2>" + EscapeHtml(section.title) + "</h2>\n" +
            section.body_html + "</section>\n";
  }
  html += "</main>\n<footer>" + EscapeHtml(footer) + "</footer>\n";
  if (!script.empty()) html += "<script>" + std::string(script) + "</script>\n";
  return html + "</body>\n</html>\n";
}

std::string ScriptSource(std::string_view script) {
  const std::string hex = Sha256Hex(script.data(), script.size());
  std::string bytes;
  for (size_t i = 0; i < hex.size(); i += 2) bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return "'sha256-" + Base64(bytes) + "'";
}

}  // namespace mvstudio::report
