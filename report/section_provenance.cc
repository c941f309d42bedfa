#include "core/join.h"
#include "core/text/shell_word.h"
#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

std::string CommandLine(const Value& entry) {
  const std::string line =
      Join(entry["argv"].items(), " ", [](const Value& word) { return ShellWord(word.Text(word.Dump())); });
  return line.empty() ? "mvstudio " + entry["command"].Text("?") : line;
}

Table::Cell Code(const std::string& text) {
  Table::Cell cell(text);
  cell.html = "<code>" + EscapeHtml(text) + "</code>";
  return cell;
}

void AddFiles(const std::string& kind, const Value& entry, const Value& files, Table* table) {
  for (const Value& file : files.items()) {
    const std::string hash = file["sha256"].Text(file["sha256_of_list"].Text());
    table->AddRow({entry["command"].Text("?"), kind, Code(file["path"].Text(file.Text("?"))),
                   FormatCount(file["bytes"].Number()), Code(hash.empty() ? kNoNumber : hash)});
  }
}

}  // namespace

Section ProvenanceSection(SectionContext* context) {
  Section section{"provenance", "Provenance", ""};
  const RunData& data = context->data;
  std::vector<Value> entries;
  for (const JsonFile& file : data.provenance) entries.push_back(file.value);
  if (entries.empty()) {
    for (const Stage& stage : data.stages) {
      Value entry = stage.result;
      entries.push_back(entry.Set("wall_s", stage.result.Path("timing.wall_s")));
    }
  }
  Table commands("");
  commands.AddColumn("time (UTC)", "", false);
  commands.AddColumn("command", "", false);
  commands.AddColumn("version", "", false);
  commands.AddColumn("exit");
  commands.AddColumn("took");
  Table files("Files");
  files.AddColumn("command", "", false);
  files.AddColumn("", "", false);
  files.AddColumn("path", "", false);
  files.AddColumn("size", "bytes");
  files.AddColumn("SHA-256", "", false);
  std::string lines;
  Value list = Value::Array();
  for (const Value& entry : entries) {
    lines += "<p><code>" + EscapeHtml(CommandLine(entry)) + "</code></p>\n";
    commands.AddRow({entry["time"].Text(kNoNumber), entry["command"].Text("?"), entry["version"].Text(kNoNumber),
                     FormatNumber(entry["exit"].Number()), FormatDuration(entry["wall_s"].Number())});
    AddFiles("in", entry, entry["inputs"], &files);
    AddFiles("out", entry, entry["outputs"], &files);
    list.Append(Value::Object()
                    .Set("time", entry["time"])
                    .Set("command", entry["command"])
                    .Set("version", entry["version"])
                    .Set("argv", entry["argv"])
                    .Set("exit", entry["exit"])
                    .Set("wall_s", entry["wall_s"])
                    .Set("inputs", entry["inputs"])
                    .Set("outputs", entry["outputs"]));
  }
  section.body_html = "<p class=\"muted\">Folder: <code>" + EscapeHtml(data.root) + "</code></p>\n";
  section.body_html += commands.empty() ? ParagraphHtml("No provenance.jsonl and no saved result in this run.", "muted")
                                        : DetailsHtml("Commands", commands.Html());
  if (!commands.empty()) section.body_html += DetailsHtml("Command lines, as they can be typed again", lines);
  if (!files.empty()) section.body_html += DetailsHtml("Inputs and outputs with their digests", files.Html());
  context->json.Set("provenance", list);
  return section;
}

}  // namespace mvstudio::report
