#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/join.h"
#include "report/page/format.h"
#include "report/page/image.h"
#include "report/page/player.h"
#include "report/page/slider.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

bool IsScalar(const Value& value) { return value.IsNumber() || value.IsText() || value.kind() == Value::Kind::kBool; }

bool IsShortNumbers(const Value& value) {
  return value.IsArray() && !value.items().empty() && value.items().size() <= 4 &&
         std::all_of(value.items().begin(), value.items().end(), [](const Value& v) { return v.IsNumber() || v.IsNull(); });
}

/// Numbers of one quantity have as many decimals as the largest needs: 0.0000, 0.0402 and not -4.21e-06, 0.04019.
std::string TogetherText(const Value& list) {
  double largest = 0;
  for (const Value& item : list.items()) {
    if (std::isfinite(item.Number())) largest = std::max(largest, std::abs(item.Number()));
  }
  const bool whole = std::all_of(list.items().begin(), list.items().end(),
                                 [](const Value& v) { return v.Number() == std::floor(v.Number()); });
  const bool plain = largest >= 1e-4 && largest < 1e7 && !whole;
  const int decimals = plain ? std::max(0, 3 - static_cast<int>(std::floor(std::log10(largest)))) : 0;
  return Join(list.items(), ", ",
              [&](const Value& item) { return plain ? FormatFixed(item.Number(), decimals) : FormatNumber(item.Number()); });
}

std::string ScalarText(const Value& value) {
  if (value.IsText()) return value.Text();
  if (value.kind() == Value::Kind::kBool) return value.Flag() ? "yes" : "no";
  if (value.kind() == Value::Kind::kInteger) return FormatCount(value.Number());
  if (IsShortNumbers(value)) return TogetherText(value);
  return FormatNumber(value.Number());
}

/// Standard deviation of the number `key` among its neighbours: of "rate_ppm" it is "rate_sigma_ppm"; NaN where there is none.
double SigmaOf(const Value& object, const std::string& key) {
  const size_t unit = std::min(key.rfind('_'), key.size());
  const bool own = key.rfind("median", 0) != 0;  // "median_sigma_mm" is the median of deviations
  return own ? object.FirstNumber({key.substr(0, unit) + "_sigma" + key.substr(unit), key + "_sigma"}) : std::nan("");
}

/// A field, with the digits that its standard deviation allows; the deviation itself with two.
std::string FieldText(const Value& object, const std::string& key) {
  const Value& value = object[key];
  if (value.kind() != Value::Kind::kNumber) return ScalarText(value);
  const double own = key.find("_sigma") != std::string::npos ? value.Number() : std::nan("");
  const double sigma = std::isfinite(own) ? own : SigmaOf(object, key);
  return sigma >= 1e-5 ? FormatWithin(value.Number(), sigma) : ScalarText(value);
}

void AddNumbers(const std::string& prefix, const Value& object, int depth, Table* table) {
  for (const auto& [key, value] : object.fields()) {
    const KeyLabel label = LabelOfKey(key);
    const std::string name = prefix + label.label;
    if (value.IsObject() && depth < 6) {
      AddNumbers(name + " \u203a ", value, depth + 1, table);
    } else if (IsScalar(value) || IsShortNumbers(value) || value.IsNull()) {
      const bool has_unit = !label.unit.empty() && !value.IsText() && !value.IsNull();
      table->AddRow({name, value.IsNull() ? kNoNumber : FieldText(object, key) + (has_unit ? "\u00a0" + label.unit : "")});
    }
  }
}

struct ColumnOfKey {
  std::string key;
  bool numeric = false;
};

constexpr size_t kMostColumns = 60;  // what a page can show

std::vector<ColumnOfKey> ColumnsOf(const Value& array, const std::vector<std::string>& skip) {
  std::vector<ColumnOfKey> columns;
  for (const Value& item : array.items()) {
    for (const auto& [key, value] : item.fields()) {
      if (std::find(skip.begin(), skip.end(), key) != skip.end()) continue;
      if (!IsScalar(value) && !IsShortNumbers(value)) continue;
      auto found = std::find_if(columns.begin(), columns.end(), [&k = key](const ColumnOfKey& c) { return c.key == k; });
      if (found == columns.end() && columns.size() == kMostColumns) continue;
      if (found == columns.end()) found = columns.insert(columns.end(), {key, false});
      found->numeric |= value.IsNumber() || value.IsArray();
    }
  }
  return columns;
}

}  // namespace

std::string NumbersTable(const std::string& caption, const Value& object) {
  Table table(caption);
  table.AddColumn("quantity", "", false);
  table.AddColumn("value");
  AddNumbers("", object, 0, &table);
  return table.empty() ? "" : table.Html();
}

std::string ObjectsTable(const std::string& caption, const Value& array, const std::vector<std::string>& skip) {
  const std::vector<ColumnOfKey> columns = ColumnsOf(array, skip);
  if (columns.empty()) return {};
  Table table(caption);
  for (const ColumnOfKey& column : columns) {
    const KeyLabel label = LabelOfKey(column.key);
    table.AddColumn(label.label, label.unit, column.numeric);
  }
  for (const Value& item : array.items()) {
    std::vector<Table::Cell> cells;
    for (const ColumnOfKey& column : columns) {
      const Value& value = item[column.key];
      cells.emplace_back(value.IsNull() ? kNoNumber : FieldText(item, column.key));
    }
    table.AddRow(std::move(cells));
  }
  return table.Html();
}

std::string FoldedTable(const std::string& title, const Value& array) {
  const std::string table = ObjectsTable("", array);
  return table.empty() ? "" : DetailsHtml(title, table);
}

std::string StageHeading(const RunData& data, const Stage& stage) {
  const bool several = data.All(stage.command).size() > 1 && !stage.folder.empty();
  return "<h3>" + EscapeHtml(stage.command) + " " + BadgeHtml(stage.verdict) +
         (several ? " <span class=\"unit\">" + EscapeHtml(stage.folder) + "</span>" : "") + "</h3>\n";
}

void SetNotRun(Section* section, const std::string& what, const std::string& command) {
  section->has_results = false;
  section->body_html = "<p class=\"muted\">" + EscapeHtml(what) + ": not run. <code>" + EscapeHtml(command) + "</code></p>\n";
}

std::string ReadOutput(SectionContext* context, const Stage& stage, const Value& output,
                       const std::function<bool(std::string_view)>& is_right, const std::string& what_is_wrong) {
  const std::string name = output["path"].Text();
  const auto [path, outside] = ResolveOutput(stage, name, context->options.follow_links);
  const auto leave_out = [&](const std::string& why, const std::string& hint) {
    context->warnings.push_back({"REP-PICTURE", stage.file + ": image " + name + " " + why, hint});
    return std::string();
  };
  if (outside) {
    context->warnings.push_back(LeadsOut(stage.file + ": image " + name));
    return {};
  }
  if (path.empty()) return leave_out("is not there", "run `" + stage.command + "` again, or copy the whole run folder");
  const std::string limits_hint = "raise --max-picture-mb or --max-pictures-total-mb to embed it";
  try {
    std::error_code code;
    const auto bytes = static_cast<int64_t>(std::filesystem::file_size(path, code));
    if (code) return leave_out("cannot be read: " + code.message(), "");
    if (bytes > int64_t{context->options.max_image_mb} << 20) return leave_out("is too large to embed", limits_hint);
    if (context->image_bytes + bytes > int64_t{context->options.max_images_total_mb} << 20) {
      return leave_out("is left out: the images together are too large", limits_hint);
    }
    std::string content = ReadFile(path);
    if (!is_right(content)) return leave_out("is " + what_is_wrong, "");
    context->image_bytes += bytes;
    return content;
  } catch (const Error& error) {
    return leave_out(std::string("cannot be read: ") + error.what(), "");
  }
}

void NeedScript(SectionContext* context, std::string_view script) {
  if (context->script.find(script) == std::string::npos) context->script += script;
}

std::string EmbedOutput(SectionContext* context, const Stage& stage, const Value& output, const std::string& caption,
                        const std::vector<std::string>& legend, bool compared) {
  const std::string content = ReadOutput(
      context, stage, output, [](std::string_view bytes) { return !ImageType(bytes).empty(); }, "neither PNG nor JPEG");
  if (content.empty()) return {};
  int width = 0, height = 0;
  const bool with_slider = compared && legend.size() > 1 && PngSize(content, &width, &height) && width >= 2 * height;
  if (with_slider) NeedScript(context, SliderScript());
  std::string html = legend.empty() ? "<div>" : with_slider ? "<div class=\"strip\" data-compared>" : "<div class=\"strip\">";
  if (!legend.empty()) {
    html += "<div class=\"legend\">";
    for (const std::string& part : legend) html += "<span>" + EscapeHtml(part) + "</span>";
    html += "</div>";
  }
  return FigureHtml(html + ImageHtml(content, caption) + "</div>", caption);
}

std::string EmbedPlayer(SectionContext* context, const Stage& stage, const Value& output) {
  const std::string content = ReadOutput(context, stage, output, IsPlayerFile, "no file of Gaussians in motion");
  if (content.empty()) return {};
  NeedScript(context, PlayerScript());
  const std::string caption =
      "The trained Gaussians at time steps of the take, moved with the fitted body; drag to turn, wheel to come closer. "
      "Colours "
      "are those of degree 0: what changes with the direction of sight is left out.";
  return FigureHtml(PlayerHtml(content, "Gaussians in motion"), caption);
}

}  // namespace mvstudio::report
