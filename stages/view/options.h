#pragma once

#include <string>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"

/// What is looked at in a browser: what a caller gives.
namespace mvstudio::stages {

/// What is shown, and how much of the disk it may lead to.
struct ViewSceneOptions {
  std::string path;            ///< a run, a session, a dataset, a calibration, or points in 3D
  std::string take;            ///< of a session; empty: its only one with people
  bool allow_outside = false;  ///< footage and images may lie outside of it
};

template <class Visitor>
void VisitFields(Visitor&& visit, ViewSceneOptions& o) {
  visit("take", o.take, "take of the session; its only one with people unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.allow_outside,
              "allow what is shown to name, or link to, files outside its folder");
}

struct ViewOptions {
  ViewSceneOptions scene;
  int port = 0;           ///< 0: any that is free
  bool open = false;      ///< start the machine's browser
  double idle_min = 3;    ///< minutes without any request, after a page was there, that end it; 0: never
  std::string rerun;      ///< folder of the npm package @rerun-io/web-viewer, for MCAP files; empty: looked for
  std::string avatar;     ///< folder of renders, CAMERA/*_%08d.png by time step; empty: the fitted body in its colours
  double cache_mb = 256;  ///< MB of images that are kept as they were sent
};

template <class Visitor>
void VisitFields(Visitor&& visit, ViewOptions& o) {
  VisitFields(visit, o.scene);
  VisitStyled(visit, OptionStyle::kSwitch, "open", o.open, "open the page in this machine's browser, where it has a display");
  visit("port", o.port, "port on 127.0.0.1; 0: any that is free");
  visit("idle-min", o.idle_min, "minutes after which a page that asks for nothing counts as closed, and this ends; 0: never");
  visit("rerun", o.rerun,
        "folder of the npm package @rerun-io/web-viewer, which shows .mcap files; default: node_modules of the working folder");
  VisitStyled(
      visit, OptionStyle::kFolder, "avatar", o.avatar,
      "folder of images to lay over each camera's, as `avatar render` with option 'frame' camera writes it; default: the "
      "fitted body in its colours");
  visit("cache-mb", o.cache_mb, "MB of images that are kept in memory");
}

}  // namespace mvstudio::stages
