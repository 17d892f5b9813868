// What scripts outside the page may ask of it.

window.splinefleet = {
  at: (t) => play.at(t),
  seek: (t) => { setFollowing(false); seek(t); },
  draw,
  choose: chooseToggled,
  get seen() { return { factor: lens.factor, ...floor.placeAt() }; },
  get time() { return now; },
  get fleetTime() { return word.time(); },
  get running() { return running; },
  get end() { return play.scene.end; },
};
