#include <algorithm>
#include <cmath>

#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

std::string UnitText(const std::string& unit) { return unit == "deg" ? "\u00b0" : unit; }

std::string ChecksTable(const Value& checks) {
  Table table("Checks");
  table.AddColumn("check", "", false);
  table.AddColumn("measured");
  table.AddColumn("bound");
  table.AddColumn("unit", "", false);
  table.AddColumn("", "", false);
  for (const Value& check : checks.items()) {
    const bool pass = check["pass"].Flag();
    const Value& at_least = check["at_least"];
    const std::string sign = at_least.kind() != Value::Kind::kBool ? "" : at_least.Flag() ? "\u2265 " : "\u2264 ";
    Table::Cell badge("");
    badge.html = BadgeHtml(pass ? Verdict::kPass : Verdict::kFail);
    table.AddRow({check["name"].Text("?"), FormatNumber(check["value"].Number(), 3),
                  sign + FormatNumber(check["bound"].Number(), 3), UnitText(check["unit"].Text()), badge},
                 !pass);
  }
  return table.Html();
}

}  // namespace

Section TruthSection(SectionContext* context) {
  Section section{"truth", "Against the ground truth", ""};
  for (const Stage& stage : context->data.stages) {
    const Value &checks = stage.metrics()["checks"], &truth = stage.metrics()["truth"];
    const bool own_truth = truth.IsObject() && stage.command != "triangulate";
    if (checks.items().empty() && !own_truth) continue;
    std::string html = StageHeading(context->data, stage);
    const bool kept =
        std::all_of(checks.items().begin(), checks.items().end(), [](const Value& c) { return c["pass"].Flag(); });
    if (!checks.items().empty()) {
      html += kept ? ParagraphHtml("All " + std::to_string(checks.items().size()) + " checks are kept.") +
                         DetailsHtml("Checks", ChecksTable(checks))
                   : ChecksTable(checks);
    }
    if (own_truth) html += DetailsHtml("All comparisons with the truth", NumbersTable("", truth));
    section.body_html += GridHtml({html}, "result");
  }
  return section;
}

}  // namespace mvstudio::report
