#include "cli/program/show_page.h"

#include <cstdio>
#include <cstdlib>

#include "core/error.h"
#include "core/log.h"
#include "core/process.h"

namespace mvstudio::cli {
namespace {

void OpenBrowser(const std::string& url, Processes* browser) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY"))
    return Log(LogLevel::kWarning, "no display is known here, so no browser is opened");
  try {
    browser->Start({"xdg-open", url}, {"/dev/null"});
  } catch (const IoError&) {
    Log(LogLevel::kWarning, "xdg-open is not installed, so no browser is opened");
  }
}

}  // namespace

stages::ShowPage ShowOn(int port, const std::string& how_it_ends, bool open) {
  return [=](const auto& answer, const auto& ended) {
    stages::PageServer server(port, answer);
    // Nothing works without this line, so it does not depend on the log's level.
    std::fprintf(stderr, "open %s in a browser on this machine; %s, or Ctrl-C here, ends it\n", server.url().c_str(),
                 how_it_ends.c_str());
    std::fflush(stderr);
    Processes browser;
    if (open) OpenBrowser(server.url(), &browser);
    server.Run(ended);
  };
}

}  // namespace mvstudio::cli
