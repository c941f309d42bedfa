#include <cstdio>

#include "cli/calib/calib.h"
#include "cli/calib/page_server.h"
#include "cli/program/options.h"
#include "stages/click/describe.h"

namespace mvstudio::cli {
namespace {

/// On 127.0.0.1; where the page is, is said.
stages::ClickServer ServeOn(int port) {
  return [port](const auto& answer, const auto& ended) {
    PageServer server(port, [&](const PageRequest& request) {
      const stages::ClickAnswer said = answer({request.method, request.path, request.body});
      return PageAnswer{said.status, said.type, said.body};
    });
    // Nothing works without this line, so it does not depend on the log's level.
    std::fprintf(stderr, "open %s in a browser on this machine; its button Finish, or Ctrl-C here, ends it\n",
                 server.url().c_str());
    std::fflush(stderr);
    server.Run(ended);
  };
}

}  // namespace

void RegisterCalibClick(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::ClickOptions>();
  CLI::App* sub = calib.add_subcommand(
      "click", "Click points in the cameras' images, in a browser on this machine, for calibrate --scene-points");
  AddOptions(sub, *options);
  sub->get_option("--points")->required();
  sub->get_option("--frame")->check(CLI::NonNegativeNumber);
  sub->get_option("--port")->check(CLI::Range(0, 65535));
  sub->get_option("--click-sigma-px")->check(CLI::PositiveNumber);
  registry.Add(sub, "calib click", [options](CommandContext& context) {
    return Describe(stages::RunClick(*options, ServeOn(options->port), context.run));
  });
}

}  // namespace mvstudio::cli
