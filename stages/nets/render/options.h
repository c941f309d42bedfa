#pragma once

#include <string>

#include "avatar/run/render/render.h"
#include "core/choice/option_style.h"

/// New images of a trained avatar: what a caller gives.
namespace mvstudio::stages {

struct AvatarRenderOptions {
  std::string run_folder;
  std::string out, video;  ///< folder of images, file; both empty: images in the run's folder
  std::string background, frames;
  double rate_hz = 0;  ///< of the video; 0: that of the poses
  bool overwrite = false;
  avatar::RenderOptions render;  ///< its frames come from the text above
};

template <class Visitor>
void VisitFields(Visitor&& visit, AvatarRenderOptions& o) {
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out,
              "folder of the images; RUN/render unless given or only option 'video' is asked for");
  visit("video", o.video, "video file, .mp4; with several cameras one each, NAME_CAMERA.mp4");
  visit("background", o.background,
        "colour (black, white, grey, green, #rrggbb or r,g,b) or image behind the person; none: PNG with opacity (videos: "
        "black)");
  visit("frames", o.frames, "frames to render, e.g. 90-119; those held out unless given (other takes: all)");
  visit("fps", o.rate_hz, "Hz; frame rate of the video; 0: that of the poses");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace what is at option 'out' or option 'video'");
  VisitFields(visit, o.render);
}

}  // namespace mvstudio::stages
