#include "report/page/picture.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

bool IsMp4(std::string_view bytes) { return bytes.size() > 12 && bytes.substr(4, 4) == "ftyp"; }

std::string EmbedVideo(SectionContext* context, const Stage& stage, const Value& output) {
  const std::string content = ReadOutput(context, stage, output, IsMp4, "no .mp4");
  if (content.empty()) return {};
  const std::string path = output["path"].Text();
  return FigureHtml("<video controls loop muted src=\"data:video/mp4;base64," + Base64(content) + "\"></video>",
                    "The avatar in motion: " + WordsOf(path.substr(path.rfind('/') + 1)));
}

}  // namespace

Section PreviewSection(SectionContext* context) {
  Section section{"preview", "Preview", ""};
  for (const Stage& stage : context->data.stages) {
    for (const Value& output : stage.result["outputs"].items()) {
      const std::string role = output["role"].Text();
      if (role == "video") section.body_html += EmbedVideo(context, stage, output);
      if (role == "gaussians-player" && ForClient(context->options)) section.body_html += EmbedPlayer(context, stage, output);
    }
  }
  return section;
}

}  // namespace mvstudio::report
