#include <algorithm>

#include "report/page/format.h"
#include "stages/study/avatar_table.h"

namespace mvstudio::stages {
namespace {

using Lines = std::vector<std::vector<std::string>>;

std::string Number(const Spread& spread, int decimals) {
  if (spread.n == 0) return report::kNoNumber;
  const std::string mean = report::FormatFixed(spread.mean, decimals);
  return spread.n > 1 ? mean + " \u00b1 " + report::FormatFixed(spread.half_range, decimals) : mean;
}

std::string Cell(const ComparisonRow& row, const std::string& kind, const std::string& key, int decimals) {
  const auto split = row.splits.find(kind);
  if (split == row.splits.end() || !split->second.values.count(key)) return report::kNoNumber;
  return Number(split->second.values.at(key), decimals) + (split->second.same_images ? "" : " \u2020");
}

std::string StudyText(const std::vector<StudyCell>& cells) {
  std::string text;
  for (const StudyCell& cell : cells) {
    text += (text.empty() ? "" : "; ") + report::FormatFixed(100 * cell.share, 0) + " % against " + cell.against + " [" +
            report::FormatFixed(100 * cell.low, 0) + ", " + report::FormatFixed(100 * cell.high, 0) + "]";
  }
  return text.empty() ? report::kNoNumber : text;
}

/// A column of one split; `name` in words.
struct Column {
  std::string kind, key, name;
  int decimals;
};

std::vector<Column> Columns(const Comparison& comparison) {
  static const std::pair<const char*, const char*> kKinds[] = {{"held-out cameras in training frames", "cameras held out"},
                                                               {"training cameras in held-out frames", "motion held out"},
                                                               {"held-out cameras in held-out frames", "both held out"}};
  const auto has = [&](const std::string& kind, const std::string& key) {
    return std::any_of(comparison.rows.begin(), comparison.rows.end(), [&](const ComparisonRow& row) {
      return row.splits.count(kind) && row.splits.at(kind).values.count(key);
    });
  };
  std::vector<Column> columns;
  for (const auto& [kind, name] : kKinds) {
    const std::vector<Column> of_split = {{kind, "ssim", std::string(name) + ": SSIM", 4},
                                          {kind, "fd", comparison.distance_name, 2},
                                          {kind, "psnr_db", "PSNR, dB", 2},
                                          {kind, "mask_iou", "mask IoU", 3},
                                          {kind, "kid", "KID", 3},
                                          {kind, "lpips", "LPIPS", 3}};
    for (size_t i = 0; i < of_split.size(); ++i) {
      if (has(kind, of_split[i].key) && (i < 2 || kind == comparison.primary)) columns.push_back(of_split[i]);
    }
  }
  return columns;
}

/// Columns of the costs that any row has: key, name and decimals.
std::vector<Column> CostColumns(const Comparison& comparison) {
  std::vector<Column> columns = {{"", "frames_per_s", "frames/s", 1},
                                 {"", "train_s", "training, s", 0},
                                 {"", "num_parameters", "parameters", 0},
                                 {"", "train_rss_mb", "memory of training, MB", 0},
                                 {"", "eval_rss_mb", "of rendering, MB", 0}};
  const auto unknown = [&](const Column& column) {
    return std::none_of(comparison.rows.begin(), comparison.rows.end(),
                        [&](const ComparisonRow& row) { return row.costs.count(column.key); });
  };
  columns.erase(std::remove_if(columns.begin(), columns.end(), unknown), columns.end());
  return columns;
}

Lines Cells(const Comparison& comparison) {
  const std::vector<Column> columns = Columns(comparison), costs = CostColumns(comparison);
  const bool study =
      std::any_of(comparison.rows.begin(), comparison.rows.end(), [](const auto& r) { return !r.study.empty(); });
  Lines lines = {{"method", "runs"}};
  for (const auto& list : {columns, costs})
    for (const Column& column : list) lines[0].push_back(column.name);
  if (study) lines[0].push_back("preferred by raters");
  for (const ComparisonRow& row : comparison.rows) {
    std::vector<std::string> line = {row.name, row.baseline ? report::kNoNumber : std::to_string(row.folders.size())};
    for (const Column& column : columns) line.push_back(Cell(row, column.kind, column.key, column.decimals));
    for (const Column& column : costs)
      line.push_back(row.costs.count(column.key) ? Number(row.costs.at(column.key), column.decimals) : report::kNoNumber);
    if (study) line.push_back(StudyText(row.study));
    lines.push_back(line);
  }
  return lines;
}

std::string Notes(const Comparison& comparison) {
  std::string text = "Mean ± half the range over the runs of a row.";
  if (!comparison.mixed_splits.empty())
    text += " † not the images of the first run: compare within one set of training cameras.";
  for (const RowDifference& d : comparison.differences) {
    text += "\n" + d.row + " - " + d.against + ": SSIM " + (d.ssim < 0 ? "" : "+") + report::FormatFixed(d.ssim, 4) +
            (!d.spread_known    ? ", the spread is not known: several seeds of each are needed"
             : d.outside_spread ? ", outside the spread of the runs"
                                : ", NOT outside the spread of the runs");
  }
  return text;
}

size_t Width(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

std::string TextTable(const Comparison& comparison) {
  const Lines lines = Cells(comparison);
  std::vector<size_t> widths(lines[0].size(), 0);
  for (const auto& line : lines) {
    for (size_t c = 0; c < line.size(); ++c) widths[c] = std::max(widths[c], Width(line[c]));
  }
  std::string text;
  for (const auto& line : lines) {
    for (size_t c = 0; c < line.size(); ++c) {
      const std::string gap(widths[c] - Width(line[c]), ' ');
      text += c == 0 ? line[c] + gap : "  " + gap + line[c];
    }
    text += "\n";
  }
  return text + Notes(comparison) + "\n";
}

std::string MarkdownTable(const Comparison& comparison) {
  const Lines lines = Cells(comparison);
  std::string text;
  for (size_t i = 0; i < lines.size(); ++i) {
    text += "|";
    for (const std::string& cell : lines[i]) text += " " + cell + " |";
    text += "\n";
    if (i > 0) continue;
    text += "|";
    for (size_t c = 0; c < lines[0].size(); ++c) text += c == 0 ? "---|" : "---:|";
    text += "\n";
  }
  const std::string notes = Notes(comparison);
  text += "\n";
  for (const char c : notes) text += c == '\n' ? std::string("\\\n") : std::string(1, c);
  return text + "\n";
}

}  // namespace mvstudio::stages
