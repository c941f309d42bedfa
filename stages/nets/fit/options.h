#pragma once

#include <string>

#include "avatar/run/pack/person_fit.h"
#include "core/choice/option_style.h"
#include "stages/nets/avatar_train_data.h"

/// A body fitted to a person of a dataset: what a caller gives.
namespace mvstudio::stages {

struct AvatarFitOptions {
  std::string dataset;  ///< folder
  std::string out;      ///< folder of the body
  SplitArguments split;
  std::string body_template = "mannequin";  ///< as TemplatesOf takes it
  avatar::PersonFitOptions person;          ///< its cameras, frames and templates come from the split and the template
  avatar::PoseBy pose_by = avatar::PoseBy::kImages;
  double frame_rate_hz = 30;  ///< of the motion in body.glb
  bool overwrite = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, AvatarFitOptions& o) {
  constexpr OptionStyle kUnset = OptionStyle::kUnset;
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder for the body");
  VisitFields(visit, o.split);
  VisitStyled(visit, kUnset, "person", o.person.person, "person id in the dataset; -1: the one with most frames");
  VisitStyled(
      visit, kUnset, "template", o.body_template,
      "body that is fitted: mannequin, a folder of MakeHuman's base mesh, rigs and targets, or a .npz or .pkl file in SMPL's "
      "layout. Of several with commas between them held-out silhouettes choose; auto: the mannequin and all in the models' "
      "folder, in bodies");
  VisitStyled(visit, kUnset, "max-silhouettes", o.person.max_silhouettes,
              "time steps are thinned until no more are used; one is kept with all its cameras");
  VisitStyled(visit, kUnset, "max-px", o.person.max_px, "longest edge of the person in the images that are fitted to");
  VisitStyled(visit, kUnset, "texture-px", o.person.texture_px, "edge of each of the 24 charts of the texture");
  VisitStyled(
      visit, kUnset, "pose-by", o.pose_by,
      "images: all frames of the split are posed by the images of the training cameras; joints: those that are fitted to");
  VisitStyled(visit, kUnset, "surface", o.person.fit_surface,
              "fit the surface to the silhouettes; off: the lengths of the bones alone, to see what the surface is worth");
  VisitStyled(visit, kUnset, "brightness", o.person.use_brightness,
              "align poses by the surface's brightness as well; kept only where held-out images agree");
  VisitStyled(
      visit, kUnset, "dynamic", o.person.dynamic,
      "a surface that moves with the pose beyond skinning. linear: offsets linear in the bones' turns; network: offsets of a "
      "network of the posed surface, trained for minutes; auto: the better of them where it beats skinning in poses far "
      "from those it was trained on; off");
  VisitStyled(visit, kUnset, "network-steps", o.person.network_steps,
              "steps of each training of a network by option 'dynamic': five that are judged, and the one that is kept");
  VisitStyled(visit, kUnset, "fps", o.frame_rate_hz, "frames a second of the motion in body.glb");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace an older body in option 'out'");
}

}  // namespace mvstudio::stages
