"""Does the cable land where it is commanded? Machine, truth, camera and controller without DDS."""
